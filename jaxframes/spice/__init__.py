"""SPICE: kernels become tables, tables become edges. The only layer that reads kernels; saved tables need none.

Kernels are read by spiceypy in a process of its own, so the caller's kernel pool is never touched.
"""

from jaxframes.spice.comparison import compare
from jaxframes.spice.kernels import Kernels
from jaxframes.spice.options import Tolerance
from jaxframes.spice.reading.kernel_files import find_kernels
from jaxframes.tables.crop_merge import crop, merge
from jaxframes.tables.store import contents, example_tables, load, save

__all__ = [
    "Kernels",
    "Tolerance",
    "compare",
    "contents",
    "crop",
    "example_tables",
    "find_kernels",
    "load",
    "merge",
    "save",
]
