"""Lets ``python -m jaxframes`` stand for the ``jaxframes`` command."""

import sys

from jaxframes.cli.main import main

sys.exit(main())
