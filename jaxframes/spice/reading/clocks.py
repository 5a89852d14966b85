"""Spacecraft clocks: encoded ticks to ET in two parts, and where a clock's rate changes."""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from jaxframes.errors import BadKernelError, MissingKernelError
from jaxframes.numerics import host_two_part
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.spice.reading.process import CspiceError
from jaxframes.time import calendar
from jaxframes.time.scales import LeapSeconds

TDB, TT = 1, 2
LEAP_SECONDS = {name: f"DELTET/{name}" for name in ("DELTA_T_A", "K", "EB", "M", "DELTA_AT")}
AGREES = 1e-6  # seconds that the coefficients may differ from CSPICE's own conversion


@dataclass(frozen=True)
class Clock:
    """A spacecraft clock.

    Attributes:
        pool: The kernels that it is of.
        id: Its SPICE id.
        ticks: Where each piece of its rate begins, encoded ticks [n]; empty where CSPICE converts.
        seconds: The parallel time there.
        rates: Seconds a tick from there on, in two parts [2, n].
        terrestrial: Where the parallel time is TT, the numbers K, EB, M0 and M1 of TDB - TT, which is to be added.
    """

    pool: KernelPool
    id: int
    ticks: np.ndarray
    seconds: np.ndarray
    rates: np.ndarray
    terrestrial: tuple[float, ...] | None

    def pieces(self) -> list[tuple[int, float, float]]:
        """Return the pieces of the clock's rate: number, first tick, last tick + 1.

        A piece serves, as in CSPICE, until the instant where the next one starts. Where that is not the instant at which its own
        count arrives there, counts repeat or are left out.
        """
        if not len(self.ticks):
            return [(0, -np.inf, np.inf)]
        length = np.diff(self.seconds) / self.rates[0][:-1]
        ends = np.append(self.ticks[:-1] + length, np.inf)
        starts = np.concatenate([[-np.inf], self.ticks[1:]])
        return list(zip(range(len(ends)), starts.tolist(), ends.tolist(), strict=True))

    def seconds_of(self, ticks: np.ndarray, piece: int | None = None) -> host_two_part.Pair:
        """Return ET of encoded ticks [n], in two parts; by one piece of the clock's rate, or by the one that each tick belongs to.

        CSPICE returns one double, 1.2e-7 s apart today: half a microradian of a spinner. The clock's own coefficients give all digits.
        """
        if not len(self.ticks):
            return self.by_cspice(ticks), np.zeros(len(ticks))
        at = np.clip(np.searchsorted(self.ticks, ticks, "right") - 1, 0, None) if piece is None else np.full(len(ticks), piece)
        past = host_two_part.two_sum(ticks, -self.ticks[at])
        moved = host_two_part.multiply(past, (self.rates[0][at], self.rates[1][at]))
        found = host_two_part.add(moved, (self.seconds[at], np.zeros(len(ticks))))
        if self.terrestrial is not None:
            k, eb, m0, m1 = self.terrestrial
            mean = m0 + m1 * found[0]
            found = host_two_part.add(found, (k * np.sin(mean + eb * np.sin(mean)), np.zeros(len(ticks))))
        return found

    def by_cspice(self, ticks: np.ndarray) -> np.ndarray:
        """Return ET of encoded ticks as CSPICE rounds it."""
        return self.pool.ticks_to_et(self.id, ticks)


def clock_of(pool: KernelPool, ck_id: int) -> Clock:
    """Return the clock that a CK id counts in.

    Raises:
        MissingKernelError: If no SCLK kernel for it is loaded.
    """
    number = pool.clock_id(ck_id)
    plain = Clock(pool, number, np.zeros(0), np.zeros(0), np.zeros((2, 0)), None)
    key = f"_{-number}"
    table, moduli, system = _numbers(pool, *(f"SCLK01_{name}{key}" for name in ("COEFFICIENTS", "MODULI", "TIME_SYSTEM")))
    try:
        probes = table[::3] if len(table) else np.array([0.0, 1e6])
        own = plain.by_cspice(probes)
    except CspiceError as error:
        if error.short not in ("SPICE(KERNELVARNOTFOUND)", "SPICE(NOLEAPSECONDS)", "SPICE(MISSINGTIMEINFO)"):
            raise
        what = "leapseconds kernel (LSK)" if error.short != "SPICE(KERNELVARNOTFOUND)" else "spacecraft clock kernel (SCLK)"
        raise MissingKernelError(
            f"C-kernels count time in ticks of clock {number}: load its {what}. CSPICE says {error.short}: {error}"
        ) from error
    kind = int(system[0]) if len(system) else TDB
    lsk = _numbers(pool, *(f"DELTET/{name}" for name in ("K", "EB", "M"))) if kind == TT else []
    if not len(table) or len(table) % 3 or not len(moduli) or kind not in (TDB, TT) or any(not len(x) for x in lsk):
        return plain
    ticks, seconds, rates = table.reshape(-1, 3).T
    per_major = np.full(len(ticks), float(np.prod(moduli[1:])))
    pair = host_two_part.divide((rates, np.zeros(len(rates))), per_major)
    made = Clock(pool, number, ticks, seconds, np.array(pair), tuple(float(v) for x in lsk for v in x) if lsk else None)
    return made if np.abs(made.seconds_of(probes)[0] - own).max() < AGREES else plain


def _numbers(pool: KernelPool, *names: str) -> list[np.ndarray]:
    """Return the numbers of kernel variables, empty arrays for those that do not exist."""
    found = pool.numbers(names, doing=f"reading {names[0]}")
    return [np.asarray(found[name] or [], float) for name in names]


def read_leap_seconds(pool: KernelPool) -> LeapSeconds:
    """Return the table of the leap-seconds kernel loaded.

    Raises:
        MissingKernelError: If none is loaded.
        BadKernelError: If its numbers make no sense.
    """
    numbers = pool.numbers(tuple(LEAP_SECONDS.values()), doing="reading the leap seconds")
    found = {name: numbers[full] for name, full in LEAP_SECONDS.items()}
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
    (m0, m1), files = found["M"] or (0.0, 0.0), ", ".join(file.name for file in pool.text)
    as_of = f"kernels {files}; last entry {calendar.date_text(starts[-1][0])}"
    return LeapSeconds(starts, Fraction(str(single["DELTA_T_A"])), single["K"], single["EB"], m0, m1, as_of)
