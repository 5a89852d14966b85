"""Cropping tables to a span and merging them in time: the same records, so the same values."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any, TypeVar, cast

import jax.numpy as jnp
import numpy as np

from jaxframes.errors import CoverageError, TableError
from jaxframes.numerics import host_two_part
from jaxframes.tables.base import Table
from jaxframes.tables.index import build_index, irregular
from jaxframes.tables.info import Info, decimal
from jaxframes.tables.instants import Instant, exact_seconds, span_text, split, two_parts
from jaxframes.tables.records import RecordTable, host_arrays, to_record_table
from jaxframes.tables.store import KINDS, MODELS, has_low

T = TypeVar("T", bound=Table)
NOT = "{!r} is no table."
CLOSE = Fraction(1, 10**6)


def crop(table: T, start: Instant | None = None, stop: Instant | None = None) -> T:
    """Return a table of the part of the span between two instants: the records that serve it, and no others.

    Args:
        table: Any table.
        start: New start; calendar text with its scale, seconds past J2000 TDB, or ``Epoch``. Default: as it is.
        stop: New end. Default: as it is.

    Raises:
        CoverageError: If the table does not cover the span.
        TableError: If it is no table, or holds at every instant.
    """
    if not isinstance(table, Table):
        raise TableError(
            f"{table!r} has no span to be cropped: it holds at every instant." if isinstance(table, MODELS) else NOT.format(table)
        )
    info = table.info
    have = Fraction(info.start), Fraction(info.stop)
    low = exact_seconds(start, "start") if start is not None else have[0]
    high = exact_seconds(stop, "stop") if stop is not None else have[1]
    if not have[0] <= low < high <= have[1]:
        raise CoverageError(f"{table.describe()} covers {span_text(*have)}: it cannot be cropped to {span_text(low, high)}.")
    reference = Fraction(info.reference)
    record_tables, kept = [], slice(0, None)
    for records in table.record_tables:
        arrays = host_arrays(records)
        starts = starts_of(arrays)
        first = max(sum(s <= low - reference for s in starts) - 1, 0)
        last = max(sum(s < high - reference for s in starts), first + 1)
        kept = slice(first, last)
        cut = {"rows": arrays["rows"][kept]}
        if "ends" not in arrays:
            cut["grid"] = np.array([*two_parts(starts[first]), arrays["grid"][2]])
            compares = 0
        else:
            index, compares = irregular(starts[kept], max(high - reference, starts[last - 1] + CLOSE))
            cut |= index
        record_tables.append(_records(cut, records, compares, info))
    return _made(
        table,
        tuple(record_tables),
        replace(info, start=decimal(low), stop=decimal(high)),
        {n: getattr(table, n)[kept] for n in _by_record(info)},
    )


def merge(*tables: Any) -> Any:
    """Return tables that follow one another in time as one; or bundles (dicts of tables by name) as one bundle.

    Tables must say the same thing (body or frame, centre, axes, record tables) and touch or overlap; where they overlap, the one that
    starts later serves. In bundles, tables of the same name are put together so.

    Raises:
        TableError: If tables cannot be put together.
        CoverageError: If there is a gap between them.
    """
    if not tables:
        raise TableError("merge: give at least one table or bundle.")
    if all(isinstance(t, Mapping) for t in tables):
        names = dict.fromkeys(name for bundle in tables for name in bundle)
        return {name: merge(*(bundle[name] for bundle in tables if name in bundle)) for name in names}
    if all(isinstance(t, MODELS) and t.info == tables[0].info for t in tables):
        return tables[0]  # a model holds at every instant: nothing to put together
    if not all(isinstance(t, Table) for t in tables):
        raise TableError(f"merge takes tables of one kind or bundles of them, not {', '.join(type(t).__name__ for t in tables)}.")
    ordered = sorted(cast(Sequence[Table], tables), key=lambda t: Fraction(t.info.start))
    if len(ordered) == 1:
        return ordered[0]
    _check(ordered)
    first, info = ordered[0], ordered[0].info
    begins = [Fraction(t.info.start) for t in ordered]
    ends = [*begins[1:], Fraction(ordered[-1].info.stop)]
    parts = [crop(t, a, b) for t, a, b in zip(ordered, begins, ends, strict=True) if a < b]
    begins = [Fraction(t.info.start) for t in parts]
    reference = Fraction(info.reference)
    record_tables, keep = [], []
    for k, records in enumerate(first.record_tables):
        arrays, keep, starts, last = [], [], [], None
        for part, begin in zip(parts, begins, strict=True):
            own = host_arrays(part.record_tables[k])
            shift = Fraction(part.info.reference) - reference
            edges = [s + shift for s in starts_of(own)]
            rows = _shifted(own["rows"], shift, part.record_tables[k].series, max(p.record_tables[k].rows.shape[1] for p in parts))
            same = last is not None and np.array_equal(rows[0], last, equal_nan=True)  # one record cut in two
            last = rows[-1]
            if not same:
                edge = edges[0]
                starts.append(edge if not arrays or abs(edge - (begin - reference)) <= CLOSE else begin - reference)
            starts += edges[1:]
            arrays.append(rows[1:] if same else rows)
            keep.append(slice(1 if same else 0, None))
        index, compares = build_index(starts, ends[-1] - reference)
        record_tables.append(_records({"rows": np.concatenate(arrays), **index}, records, compares, info))
    more = {n: jnp.concatenate([getattr(p, n)[k] for p, k in zip(parts, keep, strict=True)]) for n in _by_record(info)}
    return _made(first, tuple(record_tables), _joined_info([t.info for t in ordered], ends[-1]), more)


def starts_of(arrays: dict[str, np.ndarray]) -> list[Fraction]:
    """Return where each record of a record table starts to serve, exact seconds past the reference."""
    origin = Fraction(arrays["grid"][0]) + Fraction(arrays["grid"][1])
    if "ends" not in arrays:
        width = Fraction(arrays["grid"][2])
        return [origin + i * width for i in range(len(arrays["rows"]))]
    return [origin, *(Fraction(a) + Fraction(b) for a, b in arrays["ends"][:-1])]


def _by_record(info: Info) -> tuple[str, ...]:
    """Return the names of a table's arrays, beside the record tables, that have a row for each record."""
    return tuple(name for name in KINDS[info.kind].arrays if name == "spins")


def _records(arrays: dict[str, np.ndarray], like: RecordTable, compares: int, info: Info) -> RecordTable:
    return to_record_table(arrays, like.series, compares, like.rows.dtype, has_low(info.kind))


def _made(table: T, record_tables: tuple[RecordTable, ...], info: Info, more: dict[str, Any]) -> T:
    reference, start, stop = (Fraction(x) for x in (info.reference, info.start, info.stop))
    parts = [split(*two_parts(x - reference), np.dtype(table.span.dtype)) for x in (start, stop)]
    return table.replace(record_tables=record_tables, span=jnp.asarray(np.array(parts).reshape(-1)), info=info, **more)


def _shifted(rows: np.ndarray, shift: Fraction, series: int, width: int) -> np.ndarray:
    """Return rows counted from another reference, their series filled up with zeros to a width."""
    high, low = two_parts(shift)
    count = len(rows)
    moved = host_two_part.add((rows[:, -3], rows[:, -2]), (np.full(count, high), np.full(count, low)))
    zeros = np.zeros((count, width - rows.shape[1]))
    return np.concatenate([rows[:, :-3], zeros, moved[0][:, None], moved[1][:, None], rows[:, -1:]], 1)


def _check(ordered: Sequence[Table]) -> None:
    first = ordered[0]
    for other in ordered[1:]:
        for what in ("kind", "of_id", "relative_id", "axes", "correction"):
            a, b = getattr(first.info, what), getattr(other.info, what)
            if a != b:
                raise TableError(
                    f"{first.describe()} and {other.describe()} cannot be merged: {what} is {a!r} of one and {b!r} of the other."
                )
        shapes = [[(records.series, records.rows.dtype.name) for records in t.record_tables] for t in (first, other)]
        if shapes[0] != shapes[1]:
            raise TableError(
                f"{first.describe()}: the tables have different record tables (series, dtype): {shapes[0]} and {shapes[1]}. Make them "
                "alike: the same way, or kernels.translation(..., compose=True)."
            )
        kind = KINDS[first.info.kind]
        fixed = [name for name in kind.arrays if name not in _by_record(first.info)]
        if any(not np.array_equal(getattr(first, n), getattr(other, n)) for n in fixed) or any(
            getattr(first, n) != getattr(other, n) for n in kind.static
        ):
            raise TableError(f"{first.describe()}: the tables differ in {', '.join((*fixed, *kind.static))}.")
    end = Fraction(first.info.stop)
    for other in ordered[1:]:
        if Fraction(other.info.start) > end:
            raise CoverageError(f"{first.describe()}: nothing covers {span_text(end, Fraction(other.info.start))} between the tables.")
        end = max(end, Fraction(other.info.stop))
    if end > Fraction(ordered[-1].info.stop):
        raise TableError(f"{first.describe()}: a table lies within another one; crop the outer one around it first.")


def _joined_info(infos: Sequence[Info], stop: Fraction) -> Info:
    worst: dict[str, float] = {}
    for name, value in (pair for info in infos for pair in info.measured):
        worst[name] = max(worst.get(name, value), value)
    unique = lambda name: tuple(dict.fromkeys(x for info in infos for x in getattr(info, name)))  # noqa: E731
    return replace(
        infos[0],
        stop=decimal(stop),
        sources=unique("sources"),
        segments=unique("segments"),
        notes=unique("notes"),
        measured=tuple(worst.items()),
        method="; ".join(dict.fromkeys(info.method for info in infos)),
    )
