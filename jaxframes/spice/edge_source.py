"""Kernels as the source of the edges of a tree: exact where that is possible, fitted where it is not."""

import functools
from collections.abc import Callable, Collection
from fractions import Fraction

from jaxframes.edges.base import Edge
from jaxframes.edges.fixed import Fixed
from jaxframes.errors import NoPathError, ToleranceError
from jaxframes.spatial import Transform
from jaxframes.spice.options import Tolerance, checked_bridge, checked_tolerance
from jaxframes.spice.reading.frame_chain import anchored
from jaxframes.spice.reading.naming import CK, INERTIAL, TK
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.spice.reading.segment_paths import Walk
from jaxframes.tables.base import Table
from jaxframes.tables.instants import Instant, exact_seconds
from jaxframes.tables.naif_ids import J2000
from jaxframes.tables.placing import EdgeSource
from jaxframes.tables.translation import place_at_rest


class KernelSource(EdgeSource):
    """Kernels as the source of edges over one span."""

    def __init__(
        self,
        pool: KernelPool,
        translation: Callable[..., Edge],
        orientation: Callable[..., Edge],
        start: Instant | None,
        stop: Instant | None,
        ck: str,
        bridge: float | None,
        tolerance: Tolerance | None,
    ):
        """Take open kernels, the span that edges shall cover, and what the classes of frames ask for.

        Args:
            pool: The kernels.
            translation: ``Kernels.translation`` of them.
            orientation: ``Kernels.orientation`` of them.
            start: Start of the span, if it is given.
            stop: End of the span, likewise.
            ck: As in ``Kernels.orientation``.
            bridge: Likewise.
            tolerance: As in ``Kernels.tree``.
        """
        self._pool, self._start, self._stop = pool, start, stop
        self._translation, self._orientation = translation, orientation
        low, high = (None if x is None else exact_seconds(x, name) for x, name in ((start, "start"), (stop, "stop")))
        self.asked: tuple[Fraction | None, Fraction | None] = (low, high)
        self._own_axes: dict[int, tuple[int, str] | None] = {}
        self._tolerance, self._knots = checked_tolerance(tolerance), {"ck": ck, "bridge": checked_bridge(bridge)}

    def body(self, body: str | int) -> tuple[int, str]:
        """See ``EdgeSource``."""
        number = self._pool.body(body, "body")
        return number, self._pool.body_name(number)

    def frame(self, body: int, frame: str | int | None) -> tuple[int, str]:
        """See ``EdgeSource``."""
        found = self._pool.frame(self._default(body) if frame is None else frame)
        return found.id, found.name

    def own_axes(self, body: int) -> tuple[int, str] | None:
        """See ``EdgeSource``: the frame that all segments of the body over the span are fixed to."""
        if body not in self._own_axes:
            own = [s for s in self._pool.segments if s.kind == "SPK" and s.body == body]
            low, high = self.asked
            frames = {s.frame for s in own if (high is None or s.begin < high) and (low is None or s.end > low)}
            known = [self._pool.find_frame(frame) for frame in frames]
            anchors = {anchored(self._pool, frame).frame for frame in known if frame is not None}
            turning = [frame for frame in anchors if frame.frame_class != INERTIAL]
            self._own_axes[body] = (turning[0].id, turning[0].name) if len(turning) == len(anchors) == 1 and None not in known else None
        return self._own_axes[body]

    def _default(self, body: int) -> int:
        """Return the frame of a body that is asked for without naming one.

        It is the one that its segments are fixed to, or the body-fixed frame that SPICE knows; J2000 for barycentres and spacecraft, which
        have none of their own.

        SPICE's own answers for those are surprises: ECLIPB1950 for body 0, a frame without data for the barycentre of the Earth.
        """
        own = self.own_axes(body)
        if own is not None:
            return own[0]
        found = None if body < 10 else self._pool.default_frame(body)
        return J2000 if found is None else found

    def centered(self, body: int, frame: int) -> bool:
        """See ``EdgeSource``."""
        return self._pool.frame(frame).center == body

    def base(self, frame: int) -> tuple[int, str]:
        """See ``EdgeSource``."""
        facts, base = self._pool.frame(frame), J2000
        if facts.frame_class == TK:
            _, base = self._pool.fixed_offset(facts)
        elif facts.frame_class == CK:
            (first, *others) = {segment.frame for segment in self._pool.ck_segments(facts.class_id)} or {J2000}
            if not others and self._pool.frame(first).frame_class != INERTIAL:
                base = first  # an arm on a spacecraft, say
        return base, self._pool.frame(base).name

    def chain(self, body: int, there: Collection[int]) -> list[int]:
        """See ``EdgeSource``."""
        start, stop = self._pool.span(self._start, self._stop, "SPK", (body,))
        return Walk(body, self._pool.segments, start, stop, self._pool.body_name, meet=self._tolerance is not None).bodies

    def translation(self, target: int, center: int, axes: str = "J2000") -> Edge:
        """See ``EdgeSource``. Exact where that is possible, else fitted if there is a tolerance; fixed where nothing moves."""
        make = functools.partial(self._translation, target=target, center=center, frame=axes, start=self._start, stop=self._stop)
        if axes == "J2000":
            return self._exact_or_fitted(make, "translation")
        table = make()
        at_rest = place_at_rest(table) if isinstance(table, Table) else None
        return table if at_rest is None else Fixed(Transform.from_translation(at_rest))

    def orientation(self, frame: tuple[int, str], base: tuple[int, str]) -> Edge:
        """See ``EdgeSource``. Exact where that is possible, else fitted if there is a tolerance: dynamic and switch frames always are."""
        kind = self._pool.frame(frame[1]).frame_class
        make = functools.partial(self._orientation, frame=frame[1], relative_to=base[1], start=self._start, stop=self._stop)
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
