"""The computation: along a path and over all frames. Importing it gives trees their engine."""

from jaxframes.kinematics.queries import PathEngine
from jaxframes.tree.engine import register

register(PathEngine())
