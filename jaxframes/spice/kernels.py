"""Kernels: SPICE files opened for making tables, in a process of their own."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from types import TracebackType
from typing import Any, Self

import numpy as np

from jaxframes.errors import NoPathError
from jaxframes.spice.bundle import bundle, several
from jaxframes.spice.edge_source import KernelSource
from jaxframes.spice.extraction import orientation as extracted_orientation
from jaxframes.spice.extraction import translation as extracted_translation
from jaxframes.spice.extraction.constant_in_time import fixed_frame
from jaxframes.spice.fitting import orientation as fitted_orientation
from jaxframes.spice.fitting import translation as fitted_translation
from jaxframes.spice.inventory import Inventory
from jaxframes.spice.options import (
    OrientationRequest,
    Tolerance,
    TranslationRequest,
    checked_bridge,
    checked_correction,
    checked_layout,
    checked_size,
    checked_timeout,
    checked_tolerance,
    one_of,
)
from jaxframes.spice.reading.kernel_files import kernel_files
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.spice.reading.process import TIMEOUT
from jaxframes.tables.attitude import AttitudeTable, CayleyTable
from jaxframes.tables.fixed import FixedFrame
from jaxframes.tables.iau_model import IauOrientation
from jaxframes.tables.instants import Instant
from jaxframes.tables.naif_ids import labelled
from jaxframes.tables.orientation import OrientationTable
from jaxframes.tables.placing import OffersEdges
from jaxframes.tables.translation import TranslationTable
from jaxframes.tree.frame_tree import FrameTree


class Kernels(Inventory, OffersEdges):
    """SPICE kernels, read in a private pool: the caller's own spiceypy, if any, is neither imported nor touched.

    A process of its own holds the pool until the ``with`` block ends. What it makes are tables, which need no kernel afterwards.
    Later files win over earlier ones, and within a file later segments over earlier ones, as in SPICE, which takes segments as closed at
    both ends: the instant at which one that wins ends is still its own (and the nanosecond after it, so that epochs in two parts are
    safe; within the spacing of SPICE's own epochs). Record tables that are composed
    (``compose=True``) cannot hold two such rules at one instant: there the instant belongs to the records that follow.

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
        self._pool = KernelPool(kernel_files(paths), checked_timeout(timeout))

    def __repr__(self) -> str:
        """Return how many files, those that meta-kernels name and themselves too, and bodies are loaded."""
        files, bodies = self._pool.count, len({s.body for s in self._pool.segments if s.kind == "SPK"})
        counts = f"{files} file{'s' * (files != 1)}, {bodies} {'body' if bodies == 1 else 'bodies'}"
        return f"Kernels({counts}{', closed' if self._pool.process.closed else ''})"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """End the process that holds the kernels; tables made before stay as they are."""
        self._pool.close()

    def load(self, paths: Iterable[str | os.PathLike[str]] | str | os.PathLike[str]) -> None:
        """Load further kernels, which win over those that are loaded already; tables made before stay as they are.

        Args:
            paths: As for the class.

        Raises:
            MissingKernelError: If a file is missing.
            BadKernelError: If a file is no kernel, or is damaged. Those before it stay loaded.
        """
        self._pool.load(kernel_files(paths))

    def translation(
        self,
        *,
        target: str | int | None = None,
        center: str | int | None = None,
        of: str | int | None = None,
        relative_to: str | int | None = None,
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
            of: Another name of ``target``, that of the queries of a tree.
            relative_to: Another name of ``center``, likewise.
            frame: Frame whose axes parent and child have: inertial; or the one that the bodies' segments are given in, as stations and
                landers are in frames fixed to their body.
            start: Start of the coverage: text as ``Epoch.from_text`` reads it, ET seconds, or ``Epoch``. Default: from where the
                kernels have data.
            stop: End of the coverage. Default: as far as the kernels have data.
            tolerance: Fit to within these errors, with as few bytes as possible.
            size: Fit in at most so many bytes (float64), as well as possible; with ``tolerance`` the table must meet both.
            layout: Records of the fit: ``"uniform"``, or ``"dyadic"``, halved where the motion asks for it.
            correction: ``"NONE"``, or an aberration correction of SPICE that the fit contains: ``"CN"``, ``"CN+S"``, ``"XCN"`` or
                ``"XCN+S"``; ``"LT"`` and its kin for compatibility: SPICE's velocities are then not the derivatives of its positions,
                while the table's are.
            compose: Whether to add up the record tables of an exact chain on one grid: one look-up instead of several, at the cost of one
                more rounding of the position. Those with velocities of their own (type 3) stay as they are.

        Raises:
            UnknownBodyError: If a body is unknown.
            UnknownAxesError: If the frame is unknown.
            NoPathError: If the kernels do not connect the bodies, or the axes turn.
            CoverageError: If the kernels do not cover the span.
            ToleranceError: If no table meets the tolerance: names the errors that were reached.
        """
        pool = self._pool
        body, base = pool.body(*one_of(target=target, of=of)), pool.body(*one_of(center=center, relative_to=relative_to))
        names = pool.body_name(body), pool.body_name(base)
        if body == base:
            raise NoPathError(f"target and center are the same body, {labelled(names[0], body)}: use jf.edges.Fixed().")
        correction, axes = checked_correction(correction), pool.frame(frame, "frame").name
        bounds = pool.span(start, stop, "SPK", (body, base))
        tolerance, size = checked_tolerance(tolerance), checked_size(size)
        layout = checked_layout(layout, tolerance is not None or size is not None or correction != "NONE")
        looked_up = (names[0], body, names[1], base, axes)
        if tolerance is not None or size is not None or correction != "NONE":
            pool.inertial_frame(frame, "frame")
        request = TranslationRequest(looked_up, bounds, tolerance, size, layout, correction, compose)
        return (fitted_translation if request.fitted else extracted_translation).translation(pool, request)

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
    ) -> OrientationTable | IauOrientation | AttitudeTable | CayleyTable | FixedFrame:
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
        pool = self._pool
        of, base = pool.frame(frame), pool.frame(relative_to, "relative_to")
        bridge, tolerance = checked_bridge(bridge), checked_tolerance(tolerance)
        request = OrientationRequest(of, base, start, stop, ck, tolerance, checked_layout(layout, tolerance is not None), bridge)
        edge = fixed_frame(pool, request)
        if edge is None:
            edge = (extracted_orientation if tolerance is None else fitted_orientation).orientation(pool, request)
        return edge.replace(info=replace(edge.info, center=of.center))

    def states(
        self,
        *,
        target: str | int | None = None,
        center: str | int | None = None,
        of: str | int | None = None,
        relative_to: str | int | None = None,
        times: Any,
        frame: str = "J2000",
        correction: str = "NONE",
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return what CSPICE itself says (``spkez``): positions [n, 3] in m and velocities [n, 3] in m/s.

        One call of CSPICE an epoch: to check tables against, not to compute with.

        Args:
            target: Body by name or id.
            center: Body that the states are relative to.
            of: Another name of ``target``.
            relative_to: Another name of ``center``.
            times: Seconds past J2000 TDB, [n].
            frame: Frame of the axes.
            correction: SPICE's aberration correction.

        Raises:
            SpiceError: If CSPICE has no answer for one of the epochs.
        """
        pool, axes = self._pool, self._pool.frame(frame).name
        body, base = pool.body(*one_of(target=target, of=of)), pool.body(*one_of(center=center, relative_to=relative_to))
        return pool.states(body, base, axes, np.asarray(times, float), correction, doing="computing states")

    def rotations(self, *, frame: str, times: Any, relative_to: str = "J2000") -> tuple[np.ndarray, np.ndarray]:
        """Return what CSPICE itself says (``sxform``): rotation matrices o_R_p [n, 3, 3] and angular velocities [n, 3] in rad/s.

        Matrices map coordinates of ``frame`` to ``relative_to``, velocities are in the axes of ``relative_to``.
        Arguments and errors as in ``states``.
        """
        of, base = self._pool.frame(frame).name, self._pool.frame(relative_to, "relative_to").name
        return self._pool.rotations(of, base, np.asarray(times, float), doing="computing orientations")

    def tree(
        self,
        *,
        bodies: str | int | Sequence[str | int] = (),
        frames: str | int | Sequence[str | int | tuple[str | int, str | int | None]] = (),
        root: str | int | None = None,
        start: Instant | None = None,
        stop: Instant | None = None,
        ck: str = "smooth",
        bridge: float | None = None,
        tolerance: Tolerance | None = None,
    ) -> FrameTree:
        """Return a tree of bodies and frames, ready to be queried: any of them relative to any other.

        The root is the body with J2000 axes that the kernels' data meet at: ``"SSB"``, the Solar System barycentre, where they reach it,
        else the last that all bodies' positions are relative to, or the one that all frames belong to. Each body is a frame with J2000
        axes under its SPICE name
        (``"EARTH"``), below the body that its segments are relative to; the bodies between are there too. Each frame is below
        the body that is its centre, or the frame that it is fixed to or that its C-kernel turns it against, under its SPICE name
        (``"ITRF93"``).
        So an edge between two SPICE frames is R(o from J2000), positions in J2000, R(J2000 from p).

        Args:
            bodies: Bodies by name or id; one alone needs no list.
            frames: SPICE frames by name or id, placed at the body that is their centre; or pairs (body, frame), placed at this body, as
                ``add_spice(body=, frame=)`` does: frame None or 999999 is the default frame. One name or id alone needs no list.
            root: Body to take as the root, by name or id.
            start: Start of the coverage, as in ``translation``. Default: from where the kernels have data, whatever the size.
            stop: End of the coverage.
            ck: How C-kernels are read between their knots, as in ``orientation``.
            bridge: For C-kernels of type 1, as in ``orientation``.
            tolerance: For what has to be fitted, the errors to meet: angle and rate for dynamic and switch frames and C-kernels of types
                4 to 6; position and velocity for bodies whose SPK segments are not polynomials, turn, or change their centre (the
                edge is then from the nearest body that all these centres hang on). What can be had exactly stays exact.

        Raises:
            SpiceError: If ``bodies`` or ``frames`` are neither a name, nor an id, nor a list.
            UnknownBodyError: If a body is unknown.
            UnknownAxesError: If a frame is unknown.
            NoPathError: If the kernels do not connect them, or something has to be fitted and there is no tolerance.
            CoverageError: If the kernels do not cover the span.
            ToleranceError: If a fit cannot be as good, or the tolerance says nothing about it.
        """
        source = self.edge_source(start=start, stop=stop, ck=ck, bridge=bridge, tolerance=tolerance)
        return bundle(self._pool, source, several(bodies, "bodies"), several(frames, "frames"), root)

    def edge_source(
        self,
        *,
        start: Instant | None = None,
        stop: Instant | None = None,
        ck: str = "smooth",
        bridge: float | None = None,
        tolerance: Tolerance | None = None,
    ) -> KernelSource:
        """Return what ``TreeBuilder.add_spice`` takes its edges from; options as in ``tree``."""
        return KernelSource(self._pool, self.translation, self.orientation, start, stop, ck, bridge, tolerance)
