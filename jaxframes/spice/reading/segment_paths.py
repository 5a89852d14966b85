"""Chains of segments from body to body, and the pieces that orient a frame, with errors that say why there are none."""

from collections.abc import Callable, Sequence
from fractions import Fraction

from jaxframes.errors import CoverageError, NoPathError
from jaxframes.spice.reading.segments import Piece, Segment, coverage, select
from jaxframes.tables.instants import span_text
from jaxframes.tables.naif_ids import labelled

Name = Callable[[int], str]
Span = tuple[Fraction, Fraction]


class Walk:
    """The way from a body to the centres of its segments, as far as the kernels go over a whole span.

    Attributes:
        bodies: The bodies, link by link.
        links: The pieces of segments of each link; none for a link over centres that change.
        shortfall: Why the way ends before the span does, if it does.
    """

    def __init__(self, body: int, segments: Sequence[Segment], start: Fraction, stop: Fraction, name: Name, meet: bool = False):
        """Walk.

        Args:
            body: Where to start.
            segments: Those of all bodies, in order of loading.
            start: Start of the span.
            stop: End of the span.
            name: Names a body.
            meet: Whether to go on, where a body has several centres over the span, from the nearest body that they all hang on.

        Raises:
            NoPathError: If a body has several centres, unless they are to meet and do; or the segments run in a circle.
        """
        self.bodies = [body]
        self.links: list[list[Piece]] = []
        self.shortfall: CoverageError | None = None
        while True:
            own = [s for s in segments if s.kind == "SPK" and s.body == self.bodies[-1]]
            if not own:
                return
            pieces, gaps = select(own, start, stop)
            if gaps:
                self.shortfall = shortfall(f"position of {name(self.bodies[-1])}", own, gaps, start, stop)
                return
            centers = {piece.segment.center for piece in pieces}
            if len(centers) > 1:
                ways = [Walk(c, segments, start, stop, name, meet).bodies for c in sorted(centers)] if meet else []
                common = next((b for b in ways[0] if all(b in way for way in ways)), None) if ways else None
                if common is None:
                    listed = ", ".join(sorted(name(c) for c in centers))
                    raise NoPathError(
                        f"The position of {name(self.bodies[-1])} is relative to several bodies ({listed}) between "
                        f"{span_text(start, stop)}: make one table for each part of the span, or give "
                        "tolerance=jf.spice.Tolerance(position=..., velocity=...) to have one fitted."
                    )
                centers, pieces = {common}, []
            center = centers.pop()
            if center in self.bodies:
                raise NoPathError(f"The segments loaded run in a circle: {self.text(name)}, {name(center)}.")
            self.bodies.append(center)
            self.links.append(pieces)

    def text(self, name: Name) -> str:
        """Return the bodies of the walk as text."""
        return " -> ".join(labelled(name(b), b) for b in self.bodies)


def on_the_way(bodies: Sequence[int], segments: Sequence[Segment]) -> list[int]:
    """Return one or two bodies and those that their positions are relative to, up to the first that both have, by the last segments."""
    centers = {s.body: s.center for s in segments if s.kind == "SPK"}
    chains = []
    for body in bodies:
        chain = [body]
        while (center := centers.get(chain[-1])) is not None and center not in chain:
            chain.append(center)
        chains.append(chain)
    common = next((body for body in chains[0] if body in chains[-1]), None) if len(chains) > 1 else None
    return list(dict.fromkeys(body for chain in chains for body in (chain[: chain.index(common)] if common is not None else chain)))


def translation_links(
    target: int, center: int, segments: Sequence[Segment], start: Fraction, stop: Fraction, name: Name
) -> list[tuple[int, list[Piece]]]:
    """Return the signed links whose sum is the position of a target relative to a center, over a whole span.

    Each link is (+1 or -1, its pieces in time order); the shortest way through the nearest common body, as SPICE goes.

    Raises:
        CoverageError: If segments of a body on the way exist but leave a part of the span out.
        NoPathError: If no segments connect the two.
    """
    up, down = (Walk(body, segments, start, stop, name) for body in (target, center))
    common = next((body for body in up.bodies if body in down.bodies), None)
    if common is not None:
        return [(1, link) for link in up.links[: up.bodies.index(common)]] + [
            (-1, link) for link in down.links[: down.bodies.index(common)]
        ]
    for walk in (up, down):
        if walk.shortfall is not None:
            raise walk.shortfall
    message = (
        f"The kernels loaded do not connect {name(target)} with {name(center)}: "
        f"{up.text(name)} on one side, {down.text(name)} on the other."
    )
    lost = [walk.bodies[0] for walk in (up, down) if len(walk.bodies) == 1 and walk.bodies[0] != 0]  # nothing is needed for the SSB
    hints = [_barycentre_hint(body, segments, name) for body in lost]
    raise NoPathError(" ".join([message, *hints]))


def _barycentre_hint(body: int, segments: Sequence[Segment], name: Name) -> str:
    """Return what to do about a body that has no segments."""
    bodies = {s.body for s in segments if s.kind == "SPK"}
    if not bodies:
        return "No SPK file is loaded."
    barycentre = body // 100
    if 400 <= body < 1000 and barycentre in bodies:
        return (
            f"DE kernels hold only the barycentre {barycentre} of this planet's system: ask for {name(barycentre)!r}, "
            f"or load a satellite kernel that holds {body}."
        )
    return f"No segment of {labelled(name(body), body)} is loaded: load an SPK file that holds it."


def orientation_pieces(class_id: int, frame: str, segments: Sequence[Segment], start: Fraction, stop: Fraction) -> list[Piece]:
    """Return the pieces of binary PCK segments that orient a frame, in time order.

    Raises:
        NoPathError: If no binary PCK segment of this frame is loaded.
        CoverageError: If some are, but leave a part of the span out.
    """
    own = [s for s in segments if s.kind == "PCK" and s.body == class_id]
    if not own:
        present = sorted({s.body for s in segments if s.kind == "PCK"})
        raise NoPathError(
            f"No binary PCK segment for {frame} (class id {class_id}) is loaded; class ids loaded: {present or 'none'}. "
            "Load the binary PCK (.bpc) that holds this frame; orientations from text PCK files are not tabulated."
        )
    pieces, gaps = select(own, start, stop)
    if gaps:
        raise shortfall(f"orientation of {frame}", own, gaps, start, stop)
    return pieces


def shortfall(
    what: str, own: Sequence[Segment], gaps: Sequence[tuple[Fraction, Fraction]], start: Fraction, stop: Fraction
) -> CoverageError:
    """Return the error that says what is covered, what was asked, and what is missing."""
    return uncovered(what, coverage(own), gaps, (start, stop))


def uncovered(what: str, have: Sequence[Span], gaps: Sequence[Span], asked: Span, reason: str = "") -> CoverageError:
    """Return the error that says what is covered, what was asked, and what is missing; and what CSPICE says of it."""
    held = "; ".join(span_text(*span) for span in have[:5]) or "nothing"
    missing = "; ".join(span_text(*gap) for gap in gaps[:3])
    says = f"\n  reason:  {reason}" if reason else ""
    return CoverageError(
        f"The kernels loaded do not cover the {what} over the span asked for.\n  have:    {held}\n  asked:   {span_text(*asked)}\n"
        f"  missing: {missing}{says}\nShorten the span, or load a kernel that covers it."
    )


def open_ends(have: Sequence[Span], asked: Span) -> list[Span]:
    """Return what spans in time order leave out at the ends of another; not what they leave out between."""
    inside = [(max(a, asked[0]), min(b, asked[1])) for a, b in have if b > asked[0] and a < asked[1]]
    if not inside:
        return [asked]
    return [gap for gap in ((asked[0], inside[0][0]), (inside[-1][1], asked[1])) if gap[1] > gap[0]]
