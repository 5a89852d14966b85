"""SPICE: kernels become tables, tables become edges. The only room that reads kernels; saved tables need none.

Kernels are read by spiceypy in a process of its own, so the caller's kernel pool is never touched.
"""

from jaxframes.spice.attitude import AttitudeTable, CayleyTable
from jaxframes.spice.compare import compare
from jaxframes.spice.contents import contents
from jaxframes.spice.edit import crop, merge
from jaxframes.spice.find import find_kernels
from jaxframes.spice.fixed import FixedFrame
from jaxframes.spice.iau import IauOrientation
from jaxframes.spice.kernels import Kernels
from jaxframes.spice.shipped import example_tables
from jaxframes.spice.store import load, save
from jaxframes.spice.tables import OrientationTable, TranslationTable
from jaxframes.spice.tolerance import Tolerance

__all__ = [
    "AttitudeTable",
    "CayleyTable",
    "FixedFrame",
    "IauOrientation",
    "Kernels",
    "OrientationTable",
    "Tolerance",
    "TranslationTable",
    "compare",
    "contents",
    "crop",
    "example_tables",
    "find_kernels",
    "load",
    "merge",
    "save",
]
