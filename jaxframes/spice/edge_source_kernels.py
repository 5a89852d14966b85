"""Kernels as the source of the edges that a tree is made of: exact where that is possible, fitted where it is not."""

import functools
from collections.abc import Callable, Collection
from fractions import Fraction
from typing import Any

from jaxframes.edges.base import Edge
from jaxframes.errors import NoPathError, ToleranceError
from jaxframes.spice.options import Tolerance, checked_bridge, checked_tolerance
from jaxframes.spice.reading.ck_segments import segments_of
from jaxframes.spice.reading.frame_chain import CK, INERTIAL, TK
from jaxframes.spice.reading.segment_paths import Walk
from jaxframes.tables.instants import Instant, exact_seconds
from jaxframes.tables.naif_ids import J2000
from jaxframes.tables.placing import EdgeSource


class KernelSource(EdgeSource):
    """Kernels as the source of edges over one span."""

    def __init__(
        self, kernels: Any, start: Instant | None, stop: Instant | None, ck: str, bridge: float | None, tolerance: Tolerance | None
    ):
        """Take open kernels, the span that edges shall cover, and what the classes of frames ask for."""
        self._kernels, self._start, self._stop = kernels, start, stop
        low, high = (None if x is None else exact_seconds(x, name) for x, name in ((start, "start"), (stop, "stop")))
        self.asked: tuple[Fraction | None, Fraction | None] = (low, high)
        self._tolerance, self._knots = checked_tolerance(tolerance), {"ck": ck, "bridge": checked_bridge(bridge)}

    def body(self, body: str | int) -> tuple[int, str]:
        """See ``EdgeSource``."""
        number = self._kernels._body(body, "body")
        return number, self._kernels._name(number)

    def frame(self, body: int, frame: str | int | None) -> tuple[int, str]:
        """See ``EdgeSource``."""
        axes = self._kernels._axes(str(self._default(body) if frame is None else frame))
        return axes["id"], axes["name"]

    def _default(self, body: int) -> int:
        """Return the body-fixed frame that SPICE knows for a body; J2000 for barycentres and spacecraft, which have none of their own.

        SPICE's own answers for those are surprises: ECLIPB1950 for body 0, a frame without data for the barycentre of the Earth.
        """
        found = None if body < 10 else self._kernels._process.call("body_frame", body, doing=f"looking up the frame of body {body}")
        return J2000 if found is None else found

    def centered(self, body: int, frame: int) -> bool:
        """See ``EdgeSource``."""
        return self._kernels._axes(str(frame))["center"] == body

    def base(self, frame: int) -> tuple[int, str]:
        """See ``EdgeSource``."""
        axes = self._kernels._axes(str(frame))
        base = J2000
        if axes["class"] == TK:
            _, base = self._kernels._process.call("fixed_offset", frame, doing=f"looking up the offset of {axes['name']}")
        elif axes["class"] == CK:
            bases = {s.frame for s in segments_of(self._kernels, axes["class_id"])}
            if len(bases) == 1 and self._kernels._axes(str(*bases))["class"] != INERTIAL:
                (base,) = bases  # an arm on a spacecraft, say
        return base, self._kernels._axes(str(base))["name"]

    def chain(self, body: int, there: Collection[int]) -> list[int]:
        """See ``EdgeSource``."""
        start, stop = self._kernels._span(self._start, self._stop, "SPK", (body,))
        return Walk(body, self._kernels._segments, start, stop, self._kernels._name, meet=self._tolerance is not None).bodies

    def translation(self, target: int, center: int) -> Edge:
        """See ``EdgeSource``. Exact where that is possible, else fitted if there is a tolerance."""
        make = functools.partial(self._kernels.translation, target=target, center=center, start=self._start, stop=self._stop)
        return self._exact_or_fitted(make, "translation")

    def orientation(self, frame: tuple[int, str], base: tuple[int, str]) -> Edge:
        """See ``EdgeSource``. Exact where that is possible, else fitted if there is a tolerance: dynamic and switch frames always are."""
        kind = self._kernels._axes(frame[1])["class"]
        make = functools.partial(self._kernels.orientation, frame=frame[1], relative_to=base[1], start=self._start, stop=self._stop)
        return self._exact_or_fitted(functools.partial(make, **self._knots) if kind == CK else make, "orientation")

    def _exact_or_fitted(self, make: Callable[..., Edge], kind: str) -> Edge:
        try:
            return make()
        except NoPathError as error:
            if self._tolerance is None:
                raise
            try:
                self._tolerance.bounds(kind)
            except ToleranceError as other:
                raise ToleranceError(f"{error}\nIt has to be fitted, and {other}") from None
        return make(tolerance=self._tolerance)
