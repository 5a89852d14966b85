"""Reading the records of any segment whose data are polynomials."""

from jaxframes.spice.nodes import read_nodes, read_velocities
from jaxframes.spice.process import KernelProcess
from jaxframes.spice.segments import Piece, Records, read_records

READERS = {
    **{("SPK", kind): read_nodes for kind in (8, 9, 12, 13)},
    ("SPK", 20): read_velocities,
}
"""Kind of file and type of segment -> its reader; Chebyshev segments of types 2 and 3 otherwise."""
POLYNOMIAL = {("SPK", 2), ("SPK", 3), ("PCK", 2), *READERS}


def read(process: KernelProcess, piece: Piece) -> Records:
    """Return the records of a segment that cover its piece of the span.

    Raises:
        NoPathError: If the segment's type is not made of polynomials.
        BadKernelError: If the segment is damaged.
    """
    reader = READERS.get((piece.segment.kind, piece.segment.type), read_records)
    return reader(process, piece)
