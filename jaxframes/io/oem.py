"""Orbit ephemeris messages (CCSDS 502.0-B-3, keyword = value): read as segments of states with their frames and spans, and written."""

import datetime
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Edge
from jaxframes.errors import EdgeError, FrameError, ShapeError, suggest
from jaxframes.io.ccsds import Lines, epoch_texts, epochs_of, exact
from jaxframes.tables.naif_ids import J2000, body_named
from jaxframes.tables.placing import BODY, FRAME
from jaxframes.tables.sampled import Sampled
from jaxframes.time.epoch import Epoch
from jaxframes.tree.builder import TreeBuilder

METRES = 1000.0
HEADER = ("CCSDS_OEM_VERS", "CLASSIFICATION", "CREATION_DATE", "ORIGINATOR", "MESSAGE_ID")
NEEDED = ("OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME", "TIME_SYSTEM", "START_TIME", "STOP_TIME")
OPTIONAL = ("REF_FRAME_EPOCH", "USEABLE_START_TIME", "USEABLE_STOP_TIME", "INTERPOLATION", "INTERPOLATION_DEGREE")
ORDER = (*NEEDED[:4], "REF_FRAME_EPOCH", "TIME_SYSTEM", "START_TIME", "USEABLE_START_TIME", "USEABLE_STOP_TIME", "STOP_TIME", *OPTIONAL[3:])
"""Keywords of metadata in the order in which the standard wants them."""
INERTIAL = ("ICRF", "GCRF", "EME2000", "J2000", "ICRS", "GCRS")
"""Reference frames whose axes are those of J2000 here."""
VERSIONS = ("1.0", "2.0", "3.0")


@dataclass(frozen=True)
class Covariance:
    """The covariance of a state at an instant: ``matrix`` [6, 6] of position and velocity (SI), in the axes ``frame``."""

    time: Epoch
    frame: str
    matrix: np.ndarray


@dataclass(frozen=True)
class OemSegment:
    """States of one object in one frame.

    Attributes:
        metadata: What the message says of them, by keyword (``OBJECT_NAME``, ``CENTER_NAME``, ``REF_FRAME``, ``TIME_SYSTEM``, ...).
        times: ``Epoch`` [n].
        positions: ``[n, 3]`` of the object from the centre, m.
        velocities: ``[n, 3]``, m/s.
        accelerations: ``[n, 3]``, m/s2, or None.
        covariances: Those of the message; edges make no use of them.
        comments: Comments of the segment, without the word.
    """

    metadata: dict[str, str]
    times: Epoch
    positions: np.ndarray
    velocities: np.ndarray
    accelerations: np.ndarray | None = None
    covariances: tuple[Covariance, ...] = ()
    comments: tuple[str, ...] = ()

    @classmethod
    def from_edge(
        cls, edge: Edge, times: Epoch, *, name: str, identifier: str, center: str, frame: str, scale: str = "UTC"
    ) -> "OemSegment":
        """Return the states of any edge over time at some instants: samples, a table, an orbit.

        Args:
            edge: The edge; its positions are those of the object in the axes of its parent.
            times: ``Epoch`` [n], ascending.
            name: ``OBJECT_NAME``.
            identifier: ``OBJECT_ID``, such as ``2026-012A``.
            center: ``CENTER_NAME``, such as ``EARTH``.
            frame: ``REF_FRAME``, such as ``ICRF``.
            scale: ``TIME_SYSTEM``: ``UTC``, ``TAI``, ``TT``, ``TDB`` or ``GPS``.

        Raises:
            EdgeError: An instant lies outside what the edge covers.
        """
        builder = TreeBuilder(root="center")
        builder.add("object", parent="center", edge=edge)
        tree = builder.build()
        motion = tree.motion(tree.state(time=times), of="object", relative_to="center")
        r, v = (np.asarray(x, np.float64) for x in (motion.transform.translation, motion.velocity.linear))
        if not np.isfinite(r).all():
            raise EdgeError(
                f"{edge.describe()} does not cover instant {int(np.argwhere(~np.isfinite(r).all(-1))[0][0])} of {times.shape[0]}"
            )
        first, last = epoch_texts(times[jnp.array([0, -1])], scale)
        facts = {"OBJECT_NAME": name, "OBJECT_ID": identifier, "CENTER_NAME": center, "REF_FRAME": frame, "TIME_SYSTEM": scale}
        return cls(facts | {"START_TIME": first, "STOP_TIME": last}, times, r, v)

    @property
    def useable(self) -> Epoch:
        """The first and last instant ``Epoch`` [2] that the states are meant for: the useable ones, else those of the segment."""
        facts = self.metadata
        ends = [facts.get(f"USEABLE_{end}_TIME", facts[f"{end}_TIME"]) for end in ("START", "STOP")]
        return epochs_of(ends, facts["TIME_SYSTEM"])

    def edge(self, method: str | None = None, points: int | None = None) -> Sampled:
        """Return the edge from the centre to the object, both with the axes of ``REF_FRAME``; it covers the useable span.

        Args:
            method: As for ``jf.tables.Sampled``. Default: what the message recommends, Hermite's where it recommends nothing.
            points: For ``"lagrange"``; default: the message's degree and one more.

        Raises:
            EdgeError: The message recommends what ``Sampled`` does not do: Hermite's through more than two states.
        """
        return _edge([self], method, points)


@dataclass(frozen=True)
class Oem:
    """An orbit ephemeris message: ``header`` by keyword, ``comments``, and its ``segments`` in order."""

    header: dict[str, str]
    segments: tuple[OemSegment, ...]
    comments: tuple[str, ...] = field(default=())

    @classmethod
    def from_segments(cls, segments: Sequence[OemSegment], *, originator: str, created: str | None = None) -> "Oem":
        """Return a message of segments.

        Args:
            segments: The segments, in order of time.
            originator: Who makes it.
            created: When, as UTC text; default: now.
        """
        now = created or datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%S")
        return cls({"CCSDS_OEM_VERS": "3.0", "CREATION_DATE": now, "ORIGINATOR": originator}, tuple(segments))

    def of(self, name: str | None = None) -> tuple[OemSegment, ...]:
        """Return the segments of one object, by ``OBJECT_NAME`` or ``OBJECT_ID``; it need not be named where there is one."""
        known = {key: s.metadata["OBJECT_NAME"] for s in self.segments for key in (s.metadata["OBJECT_NAME"], s.metadata["OBJECT_ID"])}
        if name is None and len(set(known.values())) == 1:
            name = next(iter(known))
        if name not in known:
            raise FrameError(f"the message has no object {name!r}.{suggest(str(name), known)}")
        return tuple(s for s in self.segments if s.metadata["OBJECT_NAME"] == known[name])

    def edge(self, name: str | None = None, method: str | None = None, points: int | None = None) -> Sampled:
        """Return one edge of all segments of an object, which follow each other at common states; each is interpolated by itself.

        Args:
            name: ``OBJECT_NAME`` or ``OBJECT_ID``.
            method: As for ``OemSegment.edge``.
            points: As for ``OemSegment.edge``.

        Raises:
            EdgeError: Segments leave a gap, overlap without a state at the end of the useable span, or are in different frames.
        """
        return _edge(self.of(name), method, points)

    def add_to(self, builder: TreeBuilder, frame: str, *, parent: str, name: str | None = None) -> None:
        """Add an object to a tree, below the frame of its centre with the axes of ``REF_FRAME``.

        Args:
            builder: Where to.
            frame: What to call it.
            parent: The frame to hang it on.
            name: ``OBJECT_NAME`` or ``OBJECT_ID``.

        Raises:
            FrameError: The parent is known, by its properties or its name, to be another body or to have other axes than the message says.
        """
        segments = self.of(name)
        facts = next((facts for known, _, _, facts in builder.frames() if known == parent), {})
        wanted, axes = segments[0].metadata["CENTER_NAME"], segments[0].metadata["REF_FRAME"]
        body, found = body_named(wanted), int(facts[BODY]) if BODY in facts else body_named(parent)
        if body is not None and found is not None and body != found:
            raise FrameError(
                f"frame {frame!r}: its states are relative to {wanted} ({body}), and {parent!r} is body {found}; hang it there"
            )
        if axes.upper() in INERTIAL and int(facts.get(FRAME, J2000)) != J2000:
            raise FrameError(f"frame {frame!r}: its states are in {axes}, and {parent!r} has the axes of SPICE frame {facts[FRAME]}")
        if axes.upper() not in INERTIAL and FRAME in facts and int(facts[FRAME]) == J2000:
            raise FrameError(
                f"frame {frame!r}: its states are in {axes}, and {parent!r} has the axes of J2000; hang it on a frame with its own"
            )
        builder.add(frame, parent=parent, edge=_edge(segments, None, None))

    def to_text(self) -> str:
        """Return the message as text: lengths in km with all their digits, times to the nanosecond."""
        lines = [f"{key} = {self.header[key]}" for key in HEADER[:1]]
        lines += [f"COMMENT {comment}" for comment in self.comments]
        lines += [f"{key} = {self.header[key]}" for key in HEADER[1:] if key in self.header]
        for segment in self.segments:
            lines += ["", *_written(segment)]
        return "\n".join(lines) + "\n"


def load_oem(source: Any) -> Oem:
    """Return the orbit ephemeris message in a file or text.

    Args:
        source: A path, or the text itself (it has line breaks).

    Raises:
        FormatError: It is no such message; the line is named, and what is wrong there: an unknown keyword, a state outside of its segment's
            span or not after the one before, a number that is none.
    """
    lines = Lines(source, "CCSDS_OEM_VERS")
    header, comments = lines.keywords(HEADER, until=("META_START",))
    lines.need(header, ("CCSDS_OEM_VERS", "CREATION_DATE", "ORIGINATOR"), "the header")
    if header["CCSDS_OEM_VERS"] not in VERSIONS:
        lines.fail(f"version {header['CCSDS_OEM_VERS']} of the format is not one of {', '.join(VERSIONS)}")
    segments = []
    while lines.more():
        lines.take("META_START")
        facts, remarks = lines.keywords((*NEEDED, *OPTIONAL), until=("META_STOP",))
        lines.need(facts, NEEDED, "the metadata")
        lines.take("META_STOP")
        segments.append(_segment(lines, facts, remarks))
    if not segments:
        lines.fail("there is no segment: META_START is missing")
    return Oem(header, tuple(segments), comments)


def _segment(lines: Lines, facts: dict[str, str], remarks: tuple[str, ...]) -> OemSegment:
    """Return the segment whose metadata were read, with the states and covariances that follow."""
    words, more = lines.rows(until=("META_START", "COVARIANCE_START"))
    if not words:
        lines.fail("a segment needs states, one a line: instant, position, velocity")
    if len(words[0]) not in (7, 10) or any(len(row) != len(words[0]) for row in words):
        wrong = next((row for row in words if len(row) != len(words[0])), words[0])
        lines.fail(f"a state is an instant and 6 numbers, or 9 with accelerations, alike in a segment; found {' '.join(wrong)[:80]!r}")
    scale = facts["TIME_SYSTEM"]
    times, numbers = epochs_of([row[0] for row in words], scale, lines), lines.numbers([row[1:] for row in words]) * METRES
    spans = {key: exact(epochs_of([facts[key]], scale, lines))[0] for key in ORDER if key.endswith("_TIME") and key in facts}
    instants = exact(times)
    if any(b <= a for a, b in itertools.pairwise(instants)):
        i = next(i for i, (a, b) in enumerate(itertools.pairwise(instants)) if b <= a)
        lines.fail(
            f"state {i + 1}, at {words[i + 1][0]}, is not after the one before; order them, and make a segment for each side of a break"
        )
    ordered = sorted(spans, key=ORDER.index)
    if any(spans[a] > spans[b] for a, b in itertools.pairwise(ordered)):
        lines.fail(f"the spans do not lie within each other: {', '.join(f'{key} {facts[key]}' for key in ordered)}")
    if instants[0] < spans["START_TIME"] or instants[-1] > spans["STOP_TIME"]:
        lines.fail(f"states from {words[0][0]} to {words[-1][0]} are outside of {facts['START_TIME']} to {facts['STOP_TIME']}")
    covariances: tuple[Covariance, ...] = ()
    if lines.at("COVARIANCE_START"):
        lines.take("COVARIANCE_START")
        covariances = _covariances(lines, facts)
        lines.take("COVARIANCE_STOP")
    r, v, a = numbers[:, :3], numbers[:, 3:6], numbers[:, 6:] if numbers.shape[1] == 9 else None
    return OemSegment(facts, times, r, v, a, covariances, (*remarks, *more))


def _covariances(lines: Lines, facts: dict[str, str]) -> tuple[Covariance, ...]:
    found: list[Covariance] = []
    frame = facts["REF_FRAME"]
    while not lines.at("COVARIANCE_STOP"):
        head, _ = lines.keywords(("EPOCH", "COV_REF_FRAME"), until=None)
        lines.need(head, ("EPOCH",), "a covariance")
        frame = head.get("COV_REF_FRAME", frame)  # it holds until another one is named
        words = [lines.row() for _ in range(6)]
        if [len(row) for row in words] != [1, 2, 3, 4, 5, 6]:
            lines.fail(f"a covariance is a lower triangle of 1 to 6 numbers a line, found {[len(row) for row in words]}")
        half = np.zeros((6, 6))
        half[np.tril_indices(6)] = lines.numbers([[word for row in words for word in row]])[0] * METRES**2
        time = epochs_of([head["EPOCH"]], facts["TIME_SYSTEM"], lines)[0]
        found.append(Covariance(time, frame, half + np.tril(half, -1).T))
    return tuple(found)


def _edge(segments: Sequence[OemSegment], method: str | None, points: int | None) -> Sampled:
    """Return the edge of segments that follow each other."""
    first = segments[0].metadata
    for segment in segments[1:]:
        for key in ("CENTER_NAME", "REF_FRAME", "INTERPOLATION", "INTERPOLATION_DEGREE"):
            if segment.metadata.get(key) != first.get(key):
                found = f"{first.get(key)} and {segment.metadata.get(key)}"
                raise EdgeError(f"segments of {first['OBJECT_NAME']} have the {key} {found}: make an edge of each, segment.edge()")
    if method is None:
        method, points = _recommended(first, points)
    instants, useable = [exact(s.times) for s in segments], [exact(s.useable) for s in segments]
    kept = [[0, len(times)] for times in instants]
    for i in range(len(segments) - 1):
        end = useable[i][1]
        if end != useable[i + 1][0] or end not in instants[i] or end not in instants[i + 1]:
            raise EdgeError(
                f"segments {i} and {i + 1} of {first['OBJECT_NAME']} do not meet: one is useable to {segments[i].useable[1].to_tdb(9)} "
                f"TDB, the other from {segments[i + 1].useable[0].to_tdb(9)} TDB, and both need a state there; make an edge of each"
            )
        kept[i][1], kept[i + 1][0] = instants[i].index(end) + 1, instants[i + 1].index(end)

    def joined(name: str) -> Any:
        parts = [getattr(s, name) for s in segments]
        if any(part is None for part in parts):
            return None
        return np.concatenate([part[a:b] for part, (a, b) in zip(parts, kept, strict=True)])

    hi, lo = (np.concatenate([np.asarray(part)[a:b] for part, (a, b) in zip(parts, kept, strict=True)]) for parts in (
        [s.times.hi for s in segments], [s.times.lo for s in segments]))  # fmt: skip
    rates = {"velocities": joined("velocities"), "accelerations": joined("accelerations")} if method == "hermite" else {}
    more = {} if points is None else {"points": points}
    start, stop = segments[0].useable[0], segments[-1].useable[1]
    ends = {
        "start": start if exact(start[None])[0] > instants[0][0] else None,
        "stop": stop if exact(stop[None])[0] < instants[-1][-1] else None,
    }
    return Sampled(Epoch(hi, lo), joined("positions"), method=method, **rates, **more, **ends)  # pyright: ignore[reportArgumentType]


def _recommended(facts: dict[str, str], points: int | None) -> tuple[str, int | None]:
    """Return the method of ``Sampled`` that a message recommends, and how many points it takes."""
    word = facts.get("INTERPOLATION", "HERMITE").upper()
    degree = facts.get("INTERPOLATION_DEGREE")
    if word == "LAGRANGE" and degree is not None:
        return "lagrange", points or int(degree) + 1
    if word == "LINEAR":
        return "linear", None
    if word == "HERMITE" and degree in (None, "3"):
        return "hermite", None
    raise EdgeError(
        f"{facts['OBJECT_NAME']}: the message recommends {word} of degree {degree}, which is not made here; say what to take instead: "
        "method='hermite' (degree 3 between two states) or method='lagrange' with points="
    )


def _written(segment: OemSegment) -> list[str]:
    facts, scale = segment.metadata, segment.metadata["TIME_SYSTEM"]
    if segment.positions.shape != segment.velocities.shape or segment.positions.shape[0] != segment.times.shape[0]:
        raise ShapeError(f"a segment has as many positions and velocities [n, 3] as instants [{segment.times.shape[0]}]")
    lines = ["META_START", *(f"COMMENT {remark}" for remark in segment.comments)]
    lines += [f"{key} = {facts[key]}" for key in ORDER if key in facts] + ["META_STOP"]
    parts = [part for part in (segment.positions, segment.velocities, segment.accelerations) if part is not None]
    rows = np.concatenate(parts, 1) / METRES
    lines += [" ".join([text, *map(repr, row)]) for text, row in zip(epoch_texts(segment.times, scale), rows.tolist(), strict=True)]
    if segment.covariances:
        lines.append("COVARIANCE_START")
        for one in segment.covariances:
            lines += [f"EPOCH = {epoch_texts(one.time[None], scale)[0]}", f"COV_REF_FRAME = {one.frame}"]
            lines += [" ".join(map(repr, (one.matrix[i, : i + 1] / METRES**2).tolist())) for i in range(6)]
        lines.append("COVARIANCE_STOP")
    return lines
