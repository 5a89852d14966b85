"""Leap seconds from a leap-seconds kernel."""

from fractions import Fraction
from typing import TYPE_CHECKING

from jaxframes.errors import BadKernelError, MissingKernelError
from jaxframes.spatial import calendar
from jaxframes.spatial.utc import LeapSeconds

if TYPE_CHECKING:
    from jaxframes.spice.kernels import Kernels

NAMES = {name: f"DELTET/{name}" for name in ("DELTA_T_A", "K", "EB", "M", "DELTA_AT")}


def read_leap_seconds(kernels: "Kernels") -> LeapSeconds:
    """Return the table of the leap-seconds kernel loaded.

    Raises:
        MissingKernelError: If none is loaded.
        BadKernelError: If its numbers make no sense.
    """
    pool = kernels._process.call("numbers", list(NAMES.values()), doing="reading the leap seconds")
    found = {name: pool[full] for name, full in NAMES.items()}
    if not any(found.values()):
        raise MissingKernelError(
            "No leap-seconds kernel is loaded: add one, such as jf.spice.find_kernels('leapseconds'). Epoch.from_utc does without: "
            "it has a table of its own; and times in TDB, TT or ET never need one."
        )
    sizes = {name: len(values or ()) for name, values in found.items()}
    pairs = found["DELTA_AT"] or []
    starts = tuple(
        (round((second + calendar.NOON) / calendar.DAY), round(offset)) for offset, second in zip(pairs[::2], pairs[1::2], strict=False)
    )
    whole = all(day * calendar.DAY - calendar.NOON == second for (day, _), second in zip(starts, pairs[1::2], strict=False))
    fits = (sizes["DELTA_T_A"], sizes["K"], sizes["EB"], sizes["M"], sizes["DELTA_AT"] % 2) == (1, 1, 1, 2, 0)
    if not (fits and starts and whole and list(starts) == sorted(set(starts))):
        raise BadKernelError(f"The leap-seconds kernel loaded is damaged: it gives {sizes} numbers, entries {starts}.")
    single = {name: (found[name] or [0.0])[0] for name in ("DELTA_T_A", "K", "EB")}
    (m0, m1), files = found["M"] or (0.0, 0.0), ", ".join(file.name for file in kernels._text)
    as_of = f"kernels {files}; last entry {calendar.date_text(starts[-1][0])}"
    return LeapSeconds(starts, Fraction(str(single["DELTA_T_A"])), single["K"], single["EB"], m0, m1, as_of)
