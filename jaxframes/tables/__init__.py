"""Numbers over time under jit: Chebyshev records, orientation models, and how they are saved. Knows no kernel.

Here are the kinds of tables, each an edge of a tree; ``jf.spice`` makes, saves and loads them.
"""

from jaxframes.tables.attitude import AttitudeTable as AttitudeTable
from jaxframes.tables.attitude import CayleyTable as CayleyTable
from jaxframes.tables.base import Table as Table
from jaxframes.tables.fixed import FixedFrame as FixedFrame
from jaxframes.tables.iau_model import IauOrientation as IauOrientation
from jaxframes.tables.info import Info as Info
from jaxframes.tables.info import Source as Source
from jaxframes.tables.orientation import OrientationTable as OrientationTable
from jaxframes.tables.sample_records import SampledRecords as SampledRecords
from jaxframes.tables.sampled import Sampled as Sampled
from jaxframes.tables.translation import TranslationTable as TranslationTable
