"""The pool of kernels loaded into a process: their segments and names, and what CSPICE computes from them."""

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np

from jaxframes.errors import BadKernelError, CoverageError, MissingKernelError
from jaxframes.spice.reading.kernel_files import ShortNames
from jaxframes.spice.reading.naming import FrameFacts, Names
from jaxframes.spice.reading.process import CspiceError, KernelProcess
from jaxframes.spice.reading.segment_paths import Span, on_the_way
from jaxframes.spice.reading.segments import CkSegment, Segment, coverage
from jaxframes.tables.instants import Instant, exact_seconds, span_text
from jaxframes.tables.records import METRES

Vectors = tuple[np.ndarray, np.ndarray]
"""Values at epochs and their rates."""


class KernelPool(Names):
    """Kernels loaded into a process of their own; later files win, and within a file later segments, as in SPICE.

    Attributes:
        process: The process.
        segments: The segments of binary SPK and PCK files, in order of loading.
        text: The text kernels loaded, and the meta-kernels.
        count: How many files are loaded, those that meta-kernels name and themselves too.
    """

    def __init__(self, files: Sequence[Path], timeout: float | None):
        """Load kernels, in order.

        Args:
            files: The files.
            timeout: Longest time in seconds that one request to CSPICE may take, None for any.

        Raises:
            MissingKernelError: If a file that a meta-kernel names is missing, or spiceypy is.
            BadKernelError: If a file is no kernel, or is damaged.
        """
        self.process, self._names = KernelProcess(timeout), ShortNames()
        try:
            self.load(files)
        except BaseException:
            self.close()
            raise

    def load(self, files: Sequence[Path]) -> None:
        """Load further kernels, in order; they win over those that are loaded already.

        Args:
            files: The files.

        Raises:
            MissingKernelError: If a file that a meta-kernel names is missing.
            BadKernelError: If a file is no kernel, or is damaged. Those before it stay loaded.
        """
        try:
            for file in files:
                self._load(file)
        finally:
            self._list()

    def _list(self) -> None:
        try:
            self.text = [Path(p).absolute() for p in self.process.call("files", ["TEXT", "META"], doing="listing the text kernels")]
            self.count = len(self.process.call("files", ["ALL"], doing="listing the kernels"))
            described = self.process.call("segments", doing="listing the segments of the kernels")
            self.segments = [Segment(**s) for s in described]
        except CspiceError as error:
            raise BadKernelError(f"The segments of the kernels cannot be listed: {error}") from error

    def _load(self, file: Path) -> None:
        doing, name = f"loading {file}", self._names.of(file)
        try:
            architecture, _ = self.process.call("kind", name, doing=doing) if file.stat().st_size else ("?", "?")
            if architecture not in ("DAF", "DAS", "KPL") and not (architecture == "?" and _is_text_kernel(file)):
                transfer = architecture in ("XFR", "DEC")
                remedy = (
                    "It is a transfer file: convert it with NAIF's tobin." if transfer else "Give binary SPK or PCK files, or text kernels."
                )
                raise BadKernelError(f"{file} is not a SPICE kernel (CSPICE says {architecture!r}). {remedy}")
            self.process.call("load", name, doing=doing)
        except CspiceError as error:
            missing = error.short in ("SPICE(NOSUCHFILE)", "SPICE(FILENOTFOUND)")  # one that a meta-kernel names
            hint = f" Relative paths in a meta-kernel count from the current directory, {Path.cwd()}." if missing else ""
            raise (MissingKernelError if missing else BadKernelError)(f"{file} cannot be loaded: {error}{hint}") from error

    def close(self) -> None:
        """End the process; more than once does nothing."""
        self.process.close()
        self._names.close()

    def version(self) -> str:
        """Return the version of CSPICE."""
        return self.process.call("version", doing="asking for the version")

    def pck_segments(self, class_id: int) -> list[Segment]:
        """Return the segments of binary PCK files that orient a frame, by its class id."""
        return [s for s in self.segments if s.kind == "PCK" and s.body == class_id]

    def ck_segments(self, instrument: int) -> list[CkSegment]:
        """Return the segments of C-kernels that orient an instrument, in order of loading."""
        listed = (CkSegment(**s) for s in self.process.call("ck_segments", doing="listing the segments of C-kernels"))
        return [segment for segment in listed if segment.instrument == instrument]

    def ck_windows(self, path: Path | str, instrument: int, rates: bool) -> list[Span]:
        """Return the spans that a C-kernel has attitudes of an instrument in, or attitudes with rates; their ends are rounded."""
        found = self.process.call("ck_windows", str(path), instrument, rates, doing=f"reading the coverage of {Path(path).name}")
        return [(Fraction(a), Fraction(b)) for a, b in found]

    def binary_files(self) -> list[Path]:
        """Return the binary kernels loaded."""
        return [Path(path) for path in self.process.call("binary_files", doing="listing the kernels")]

    def words(self, segment: Segment | CkSegment, first: int, last: int) -> np.ndarray:
        """Return double-precision words of a segment's file, float64 [last - first + 1]; addresses count from one."""
        return np.asarray(self.process.call("words", segment.handle, first, last, doing=f"reading {segment.describe()}"), np.float64)

    def numbers(self, names: Sequence[str], *, doing: str) -> dict[str, list[float] | None]:
        """Return the numbers of kernel variables, None for those that do not exist or hold text."""
        return self.process.call("numbers", list(names), doing=doing)

    def instants(self, name: str) -> list[float]:
        """Return the instants that a kernel variable holds as ET seconds, none if it does not exist."""
        return self.process.call("instants", name, doing=f"reading {name}")

    def clock_id(self, ck_id: int) -> int:
        """Return the id of the clock that a CK id counts in."""
        return int(self.process.call("clock", ck_id, doing=f"looking up the clock of {ck_id}"))

    def ticks_to_et(self, clock: int, ticks: np.ndarray) -> np.ndarray:
        """Return ET seconds of encoded ticks [n] of a clock, rounded to one double each."""
        return np.asarray(self.process.call("ticks_to_et", clock, ticks, doing=f"converting clock {clock}"), float)

    def default_frame(self, body: int) -> int | None:
        """Return the id of the frame that SPICE or an association kernel gives a body, None if it has none."""
        return self.process.call("body_frame", body, doing=f"looking up the frame of body {body}")

    def fixed_offset(self, frame: FrameFacts) -> tuple[np.ndarray, int]:
        """Return the matrix that takes coordinates of a fixed-offset (TK) frame to its base, and the id of the base."""
        matrix, base = self.process.call("fixed_offset", frame.id, doing=f"looking up the offset of {frame.name}")
        return np.array(matrix), base

    def rotation(self, source: str, destination: str) -> np.ndarray:
        """Return the matrix [3, 3] that takes coordinates from one inertial frame to another."""
        return np.array(self.process.call("rotation", source, destination, doing=f"rotating {source} to {destination}"))

    def states(self, target: int, center: int, axes: str, times: np.ndarray, correction: str = "NONE", *, doing: str) -> Vectors:
        """Return positions [n, 3] in m and velocities in m/s of a body at ET seconds, as CSPICE computes them."""
        found = self.process.call("states", target, center, axes, times, correction, doing=doing) * METRES
        return found[:, :3], found[:, 3:]

    def rotations(self, frame: str, relative_to: str, times: np.ndarray, *, doing: str) -> Vectors:
        """Return rotation matrices o_R_p [n, 3, 3] of a frame p in another, o, and its angular velocities [n, 3] in the axes of o."""
        return self.process.call("rotations", frame, relative_to, times, doing=doing)

    def rotations_or_nan(self, frame: str, relative_to: str, times: np.ndarray, *, doing: str) -> Vectors:
        """Return what ``rotations`` does, NaN at the epochs that CSPICE has no answer for."""
        return self.process.call("rotations_or_nan", frame, relative_to, times, doing=doing)

    def attitudes_or_nan(self, frame: str, relative_to: str, times: np.ndarray, *, doing: str) -> Vectors:
        """Return what ``rotations_or_nan`` does; where CSPICE has a rotation but no rate, that alone."""
        return self.process.call("attitudes_or_nan", frame, relative_to, times, doing=doing)

    def span(self, start: Instant | None, stop: Instant | None, kind: str, bodies: tuple[int, ...]) -> Span:
        """Return the span asked for; a side left out is where all data of the bodies named, and of those between, begin or end.

        Args:
            start: Start of the span, if it is given.
            stop: End of the span, likewise.
            kind: Kind of the segments: ``"SPK"`` or ``"PCK"``.
            bodies: Ids of the bodies, or of the frame within its class.

        Raises:
            CoverageError: If the data have no span in common, or the start is not before the stop.
        """
        low = exact_seconds(start, "start") if start is not None else None
        high = exact_seconds(stop, "stop") if stop is not None else None
        if low is None or high is None:
            way = on_the_way(bodies, self.segments) if kind == "SPK" else bodies
            own = {b: c for b in way if (c := coverage(s for s in self.segments if s.kind == kind and s.body == b))}
            if own:
                begin, end = max(c[0][0] for c in own.values()), min(c[-1][1] for c in own.values())
                if begin >= end:
                    have = "".join(
                        f"\n  {self.body_name(b) if kind == 'SPK' else b}: {span_text(c[0][0], c[-1][1])}" for b, c in own.items()
                    )
                    raise CoverageError(f"The data of the bodies on the way have no span in common.{have}")
            else:  # no data at all: the search for a way says so, over any span with the end that is given
                begin = Fraction(0) if high is None else high - 1
                end = begin + 1 if low is None else low + 1
            low, high = begin if low is None else low, end if high is None else high
        if low >= high:
            raise CoverageError(f"start lies at or after stop: {span_text(low, high)}. A table needs a span of time.")
        return low, high


def _is_text_kernel(file: Path) -> bool:
    """Whether a file without a kernel's first word holds kernel data nevertheless (old text kernels do)."""
    with file.open("rb") as content:
        return b"\\begindata" in content.read(1 << 20)
