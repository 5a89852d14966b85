"""Kernels: SPICE files opened for making tables, in a process of their own."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

import numpy as np

from jaxframes.errors import BadKernelError, CoverageError, MissingKernelError, NoPathError
from jaxframes.spice.extraction import joining, node_segments
from jaxframes.spice.extraction import orientation as orient
from jaxframes.spice.extraction import translation as translate
from jaxframes.spice.inventory import Inventory
from jaxframes.spice.options import Tolerance
from jaxframes.spice.reading.frame_chain import INERTIAL
from jaxframes.spice.reading.kernel_files import ShortNames, kernel_files, sha256
from jaxframes.spice.reading.process import TIMEOUT, CspiceError, KernelProcess
from jaxframes.spice.reading.segment_paths import on_the_way
from jaxframes.spice.reading.segments import Piece, Segment, coverage, handed_over
from jaxframes.tables.base import Table
from jaxframes.tables.info import Info, Source, decimal
from jaxframes.tables.instants import Instant, exact_seconds, pairs, reference_day, span_text
from jaxframes.tables.records import METRES, HostRecordTable, to_record_table
from jaxframes.tables.translation import TranslationTable

T = TypeVar("T", bound=Table)


class Kernels(Inventory):
    """SPICE kernels, read in a private pool: the caller's own spiceypy, if any, is neither imported nor touched.

    A process of its own holds the pool until the ``with`` block ends. What it makes are tables, which need no kernel afterwards.
    Later files win over earlier ones, and within a file later segments over earlier ones, as in SPICE, which takes segments as closed at
    both ends: the instant at which one that wins ends is still its own (and the nanosecond after it, so that epochs in two parts are
    safe; within the spacing of SPICE's own epochs). Legs that are composed (``compose=True``) cannot hold two such rules at one instant:
    there the instant belongs to the records that follow.

    Example:
        >>> import jaxframes as jf
        >>> with jf.spice.Kernels(jf.spice.find_kernels("de440")) as kernels:
        ...     sun = kernels.translation(target="SUN", center="SSB", start="2026-01-01", stop="2026-02-01")
    """

    def __init__(self, paths: Iterable[str | os.PathLike[str]] | str | os.PathLike[str], *, timeout: float | None = TIMEOUT):
        """Load kernels, in order.

        Args:
            paths: Files to load: binary SPK, PCK and CK, text kernels, meta-kernels (relative paths in them count from the current
                directory, as in SPICE); or directories, which stand for all kernels in them sorted by name, without meta-kernels.
            timeout: Longest time in seconds that one request to CSPICE may take, None for any; a damaged kernel can make it loop.

        Raises:
            MissingKernelError: If a file is missing, or spiceypy is.
            BadKernelError: If a file is no kernel, or is damaged.
            SpiceError: If ``timeout`` is no time.
        """
        files = kernel_files(paths)
        self._process, self._text, self._names = KernelProcess(timeout), list[Path](), ShortNames()
        try:
            for file in files:
                self._load(file)
            self._text = [Path(p).absolute() for p in self._process.call("files", ["TEXT", "META"], doing="listing the text kernels")]
            self._count = len(self._process.call("files", ["ALL"], doing="listing the kernels"))
            described = self._process.call("segments", doing="listing the segments of the kernels")
            self._segments = [Segment(**s) for s in described]
        except CspiceError as error:
            self.close()
            raise BadKernelError(f"The segments of the kernels cannot be listed: {error}") from error
        except BaseException:
            self.close()
            raise

    def _load(self, file: Path) -> None:
        doing, name = f"loading {file}", self._names.of(file)
        try:
            architecture, _ = self._process.call("kind", name, doing=doing) if file.stat().st_size else ("?", "?")
            if architecture not in ("DAF", "DAS", "KPL") and not (architecture == "?" and _is_text_kernel(file)):
                transfer = architecture in ("XFR", "DEC")
                remedy = (
                    "It is a transfer file: convert it with NAIF's tobin." if transfer else "Give binary SPK or PCK files, or text kernels."
                )
                raise BadKernelError(f"{file} is not a SPICE kernel (CSPICE says {architecture!r}). {remedy}")
            self._process.call("load", name, doing=doing)
        except CspiceError as error:
            missing = error.short in ("SPICE(NOSUCHFILE)", "SPICE(FILENOTFOUND)")  # one that a meta-kernel names
            hint = f" Relative paths in a meta-kernel count from the current directory, {Path.cwd()}." if missing else ""
            raise (MissingKernelError if missing else BadKernelError)(f"{file} cannot be loaded: {error}{hint}") from error

    def __repr__(self) -> str:
        """Return how many files, those that meta-kernels name and themselves too, and bodies are loaded."""
        files, bodies = self._count, len({s.body for s in self._segments if s.kind == "SPK"})
        counts = f"{files} file{'s' * (files != 1)}, {bodies} {'body' if bodies == 1 else 'bodies'}"
        return f"Kernels({counts}{', closed' if self._process.closed else ''})"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """End the process that holds the kernels; tables made before stay as they are."""
        self._process.close()
        self._names.close()

    def translation(
        self,
        *,
        target: str | int,
        center: str | int,
        frame: str = "J2000",
        start: Instant | None = None,
        stop: Instant | None = None,
        tolerance: Tolerance | None = None,
        size: int | None = None,
        layout: str = "uniform",
        correction: str = "NONE",
        compose: bool = False,
    ) -> TranslationTable:
        """Return the edge that carries a body's position relative to another: extracted exactly, or fitted.

        Without ``tolerance``, ``size`` and ``correction`` the polynomials of the kernel itself are taken: SPK types 2, 3, 8, 9, 12, 13
        and 20, exact to rounding. Otherwise a Chebyshev table is fitted to what CSPICE computes, for every type and correction, and its
        report states the errors met at independent epochs.

        Args:
            target: Body by name or id, e.g. ``"MOON"``, ``301``; ``"SSB"`` is the Solar System barycentre.
            center: Body that the parent frame is centred on; for corrected states the observer.
            frame: Inertial frame whose axes parent and child have.
            start: Start of the coverage: TDB calendar text, ET seconds, or ``Epoch``. Default: from where the kernels have data.
            stop: End of the coverage. Default: as far as the kernels have data.
            tolerance: Fit to within these errors, with as few bytes as possible.
            size: Fit in at most so many bytes (float64), as well as possible; with ``tolerance`` the table must meet both.
            layout: Records of the fit: ``"uniform"``, or ``"dyadic"``, halved where the motion asks for it.
            correction: ``"NONE"``, or an aberration correction of SPICE that the fit contains: ``"CN"``, ``"CN+S"``, ``"XCN"`` or
                ``"XCN+S"``; ``"LT"`` and its kin for compatibility: SPICE's velocities are then not the derivatives of its positions,
                while the table's are.
            compose: Whether to add up the record tables of an exact chain on one grid: one look-up instead of several, at the cost of one
                more rounding of the position. Legs with velocities of their own (type 3) stay as they are.

        Raises:
            UnknownBodyError: If a body is unknown.
            UnknownAxesError: If the frame is unknown.
            NoPathError: If the kernels do not connect the bodies, or the axes turn.
            CoverageError: If the kernels do not cover the span.
            ToleranceError: If no table meets the tolerance: names the errors that were reached.
        """
        return translate.translation(
            self, translate.Request(target, center, frame, start, stop, tolerance, size, layout, correction, compose)
        )

    def orientation(
        self,
        *,
        frame: str,
        relative_to: str = "J2000",
        start: Instant | None = None,
        stop: Instant | None = None,
        ck: str = "smooth",
        tolerance: Tolerance | None = None,
        layout: str = "uniform",
        bridge: float | None = None,
    ) -> Any:
        """Return the edge that carries a frame's orientation.

        A binary PCK is extracted record by record, a text PCK becomes its analytic model (exact, at every instant: ``start`` and
        ``stop`` are not used), C-kernels of types 1 to 3 become knot tables, gaps kept, and frames that do not turn against each other
        become ``jf.spice.FixedFrame``, a ``jf.edges.Fixed``: inertial ones, and those given by fixed offsets (TK) from a common frame.
        With ``tolerance`` a table is fitted to what CSPICE computes, for every other frame: dynamic and switch frames, C-kernels of
        types 4 to 6, chains.

        Args:
            frame: The frame, e.g. ``"ITRF93"``, ``"IAU_MARS"``, ``"ECLIPJ2000"``.
            relative_to: Frame that the parent has the axes of: inertial, or one that ``frame`` is fixed to.
            start: Start of the coverage, as in ``translation``; the kernels must cover it. Default: the kernel's own first instant.
            stop: End of the coverage, likewise. Gaps of C-kernels in between are kept: NaN there, and lines in the report.
            ck: Between the knots of a C-kernel: ``"smooth"``, attitude, rate and angular acceleration belong together; ``"spice"``, what
                SPICE computes, whose rate is not the derivative of its attitude.
            tolerance: Fit to within this angle and rate, with as few bytes as possible.
            layout: Records of the fit, ``"uniform"`` or ``"dyadic"``.
            bridge: C-kernels of type 1 have attitudes at instants only: those up to so many seconds apart are joined.
                Zero joins none, infinity all.

        Returns:
            An ``OrientationTable``, ``IauOrientation``, ``AttitudeTable``, ``CayleyTable`` or ``FixedFrame``, by what the frame is.

        Raises:
            UnknownAxesError: If a frame is unknown.
            NoPathError: If no data orients the frame, or ``relative_to`` turns against it.
            CoverageError: If the kernels do not cover the start or the stop, or, but for C-kernels and fits, leave a gap between them.
        """
        request = orient.Request(self._axes(frame), self._axes(relative_to, "relative_to"), start, stop, ck, tolerance, layout, bridge)
        return orient.orientation(self, request)

    def states(
        self, *, target: str | int, center: str | int, times: Any, frame: str = "J2000", correction: str = "NONE"
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return what CSPICE itself says (``spkez``): positions [n, 3] in m and velocities [n, 3] in m/s.

        One call of CSPICE an epoch: to check tables against, not to compute with.

        Args:
            target: Body by name or id.
            center: Body that the states are relative to.
            times: Seconds past J2000 TDB, [n].
            frame: Frame of the axes.
            correction: SPICE's aberration correction.

        Raises:
            SpiceError: If CSPICE has no answer for one of the epochs.
        """
        of, relative, axes = self._body(target, "target"), self._body(center, "center"), self._axes(frame)["name"]
        found = self._process.call("states", of, relative, axes, np.asarray(times, float), correction, doing="computing states")
        return found[:, :3] * METRES, found[:, 3:] * METRES

    def turns(self, *, frame: str, times: Any, relative_to: str = "J2000") -> tuple[np.ndarray, np.ndarray]:
        """Return what CSPICE itself says (``sxform``): rotation matrices o_R_p [n, 3, 3] and angular velocities [n, 3] in rad/s.

        Matrices map coordinates of ``frame`` to ``relative_to``, velocities are in the axes of ``relative_to``.
        Arguments and errors as in ``states``.
        """
        of, base = self._axes(frame)["name"], self._axes(relative_to, "relative_to")["name"]
        return self._process.call("turns", of, base, np.asarray(times, float), doing="computing orientations")

    def _table(
        self,
        kind: type[T],
        name: str,
        names: tuple[str, int, str, int, str],
        bounds: tuple[Fraction, Fraction],
        record_tables: Sequence[HostRecordTable],
        used: Sequence[Piece | Path],
        facts: dict[str, Any] | None = None,
        **more: Any,
    ) -> T:
        reference = reference_day(bounds[0])
        pieces = [piece for piece in used if isinstance(piece, Piece)]
        files = sorted({p if isinstance(p, Path) else Path(p.segment.path) for p in used}) + self._text
        lines = tuple(dict.fromkeys(f"{piece.segment.describe()}, frame id {piece.segment.frame}" for piece in pieces))
        info = Info(
            name,
            *names,
            *(decimal(x) for x in (*bounds, Fraction(reference))),
            sources=tuple(Source(f.name, sha256(f)) for f in files),
            toolkit=self._process.call("version", doing="asking for the version"),
            **{"segments": lines, **(facts or {})},
        )
        made = tuple(
            to_record_table(records.arrays, records.series, records.compares, low=kind is TranslationTable) for records in record_tables
        )
        fields = {
            "record_tables": made,
            "reference": pairs(Fraction(reference)),
            "span": pairs(*(x - reference for x in bounds)),
            "info": info,
        }
        return kind(**fields, **more)  # pyright: ignore[reportCallIssue]

    def _join(self, parts: list[tuple[Piece, np.ndarray | None]], sign: int, start: Fraction) -> tuple[HostRecordTable, list[float]]:
        records, late = [], handed_over([piece for piece, _ in parts])
        for (piece, rotation), last_instant_taken in zip(parts, late, strict=True):
            read = replace(node_segments.read(self._process, piece), late=last_instant_taken)
            records.append(read if rotation is None else joining.rotated(read, rotation))
        return joining.join(records, sign, reference_day(start)), [r.apart for r in records]

    def _rotation(self, segment: Segment, axes: str) -> np.ndarray | None:
        """Return the matrix from a segment's own inertial frame to another, None where they are the same."""
        own = self._process.call("frame", str(segment.frame), doing=f"looking up frame {segment.frame}")
        if own is None or own["class"] != INERTIAL:
            label = "unknown to the kernels loaded" if own is None else f"{own['name']}, which turns"
            raise NoPathError(f"{segment.describe()} is relative to frame {segment.frame}, {label}: only inertial frames are extracted.")
        if own["name"] == axes:
            return None
        return np.array(self._process.call("rotation", own["name"], axes, doing=f"rotating {own['name']} to {axes}"))

    def _span(self, start: Instant | None, stop: Instant | None, kind: str, bodies: tuple[int, ...]) -> tuple[Fraction, Fraction]:
        """Return the span asked for; a side left out is where all data of the bodies named, and of those between, begin or end."""
        low = exact_seconds(start, "start") if start is not None else None
        high = exact_seconds(stop, "stop") if stop is not None else None
        if low is None or high is None:
            way = on_the_way(bodies, self._segments) if kind == "SPK" else bodies
            own = {b: c for b in way if (c := coverage(s for s in self._segments if s.kind == kind and s.body == b))}
            if not own:
                return low or Fraction(0), high or Fraction(1)  # no data at all: the search for a way says so
            begin, end = max(c[0][0] for c in own.values()), min(c[-1][1] for c in own.values())
            if begin >= end:
                have = "".join(f"\n  {self._name(b) if kind == 'SPK' else b}: {span_text(c[0][0], c[-1][1])}" for b, c in own.items())
                raise CoverageError(f"The data of the bodies on the way have no span in common.{have}")
            low, high = begin if low is None else low, end if high is None else high
        if low >= high:
            raise CoverageError(f"start lies at or after stop: {span_text(low, high)}. A table needs a span of time.")
        return low, high


def _is_text_kernel(file: Path) -> bool:
    """Whether a file without a kernel's first word holds kernel data nevertheless (old text kernels do)."""
    with file.open("rb") as content:
        return b"\\begindata" in content.read(1 << 20)
