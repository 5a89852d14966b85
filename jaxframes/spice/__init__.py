"""SPICE: kernels become tables, tables become edges. The only layer that reads kernels; saved tables need none.

Kernels are read by spiceypy in a process of its own, so the caller's kernel pool is never touched.
"""

from jaxframes.spice.comparison import compare
from jaxframes.spice.kernels import Kernels
from jaxframes.spice.options import Tolerance
from jaxframes.spice.reading.kernel_files import find_kernels
from jaxframes.tables.attitude import AttitudeTable, CayleyTable
from jaxframes.tables.crop_merge import crop, merge
from jaxframes.tables.fixed import FixedFrame
from jaxframes.tables.iau_model import IauOrientation
from jaxframes.tables.orientation import OrientationTable
from jaxframes.tables.store import contents, example_tables, load, save
from jaxframes.tables.translation import TranslationTable

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
