"""Extraction of text PCK files: their constants as the analytic model of a body's orientation (NAIF's ``pck.req``)."""

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from jaxframes.errors import BadKernelError, NoPathError
from jaxframes.spice import accuracy
from jaxframes.spice.extraction.constant_in_time import constant_info
from jaxframes.spice.options import OrientationRequest
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.tables.iau_model import PAIRED, IauOrientation
from jaxframes.tables.instants import two_parts

DAY, CENTURY = 86400, 36525 * 86400
ANGLES = ("POLE_RA", "POLE_DEC", "PM")
J2000_JULIAN_DATE = 2451545


def text_pck(pool: KernelPool, request: OrientationRequest, placement: np.ndarray) -> IauOrientation:
    """Return the orientation of a frame by the constants of the text PCK files loaded.

    Args:
        pool: The kernels.
        request: What is asked for.
        placement: Quaternion of the model's inertial frame (``model_axes``) in the base asked for.

    Raises:
        NoPathError: If there are none for this body.
        BadKernelError: If some are missing, or do not fit together.
    """
    body, label = request.of.class_id, request.of.name
    system = system_of(body)
    names = [f"BODY{body}_{item}" for item in (*ANGLES, "NUT_PREC_RA", "NUT_PREC_DEC", "NUT_PREC_PM")]
    names += [f"BODY{system}_{item}" for item in ("NUT_PREC_ANGLES", "MAX_PHASE_DEGREE", "CONSTANTS_JED_EPOCH")]
    constants = pool.numbers(names, doing=f"reading the PCK constants of {label}")
    polynomials, waves = [constants[name] or [] for name in names[:3]], [constants[name] or [] for name in names[3:6]]
    missing = [name for name, found in zip(names[:3], polynomials, strict=True) if not found]
    if missing:
        raise BadKernelError(f"The text PCK files loaded orient {label} only in part: {', '.join(missing)} missing.")
    angles, degree, epoch = (constants[name] for name in names[6:])
    phases = _phases(label, system, angles or [], int(degree[0]) if degree else 1, max(map(len, waves)))
    if not all(np.isfinite(np.asarray(x, float)).all() for x in (*polynomials, *waves, angles or [])):
        raise BadKernelError(f"The PCK constants of {label} are not all finite.")
    arrays = {
        "polynomials": _rows_in_two_parts([_scaled(*pair) for pair in zip(polynomials, (CENTURY, CENTURY, DAY), strict=True)]),
        "placement": placement,
        "reference": np.array(two_parts((Fraction(epoch[0]) - J2000_JULIAN_DATE) * DAY if epoch else Fraction(0))),
    }
    amplitudes = np.zeros((len(phases), 3))
    for column, wave in enumerate(waves):
        amplitudes[: len(wave), column] = np.radians(wave)
    used = [i for i in range(len(phases)) if amplitudes[i].any()]
    arrays["amplitudes"] = amplitudes[used]
    arrays["phases"] = _rows_in_two_parts([_scaled(phases[i], CENTURY) for i in used])
    assert {*PAIRED, "amplitudes", "placement"} == set(arrays)
    info = constant_info(pool, request, "iau", "analytic model of a text PCK")
    measured = accuracy.model(pool, request.of.name, request.base.name, arrays)
    return IauOrientation.from_arrays(arrays, replace(info, measured=measured))


def model_axes(pool: KernelPool, class_id: int) -> str:
    """Return the name of the inertial frame that a body's constants are given in: J2000 unless the PCK names another."""
    name = f"BODY{system_of(class_id)}_CONSTANTS_REF_FRAME"
    found = pool.numbers([name], doing=f"reading {name}")[name]
    return pool.inertial_frame(str(int(found[0])) if found else "1", name).name


def has_text_pck(pool: KernelPool, class_id: int) -> bool:
    """Whether text PCK constants for the orientation of a body are loaded."""
    names = [f"BODY{class_id}_{angle}" for angle in ANGLES]
    return any(pool.numbers(names, doing=f"looking for PCK constants of {class_id}").values())


def no_data(pool: KernelPool, request: OrientationRequest) -> NoPathError:
    """Return the error for a PCK frame that neither a binary nor a text PCK file orients."""
    of = request.of
    present = sorted({s.body for s in pool.segments if s.kind == "PCK"})
    return NoPathError(
        f"No binary PCK segment for {of.name} (class id {of.class_id}) is loaded; class ids loaded: {present or 'none'}. "
        f"No text PCK gives BODY{of.class_id}_PM either. Load the binary (.bpc) or text (.tpc) PCK that orients this frame."
    )


def system_of(body: int) -> int:
    """Return the id that a body's phase angles go by: the planetary system's barycentre, or its own."""
    if 100 <= body <= 999:
        return body // 100
    return body // 10000 if 10000 <= body <= 99999 else body


def _phases(label: str, system: int, angles: Sequence[float], degree: int, needed: int) -> list[list[float]]:
    width = degree + 1
    if degree < 1 or len(angles) % width:
        raise BadKernelError(f"BODY{system}_NUT_PREC_ANGLES holds {len(angles)} numbers, which phases of degree {degree} do not fill.")
    if len(angles) < needed * width:
        raise BadKernelError(
            f"{label} has periodic terms in {needed} phase angles, but BODY{system}_NUT_PREC_ANGLES holds {len(angles) // width}: "
            "load the PCK that holds the angles of the whole system."
        )
    return [list(angles[i : i + width]) for i in range(0, len(angles), width)]


def _scaled(terms: Sequence[float], unit: int) -> list[Fraction]:
    """Return coefficients in degrees per power of a unit of time as turns: constant, per second, then per century to the power."""
    turns = (Fraction(term) / 360 for term in terms)
    out = [turn if k == 0 else turn / unit if k == 1 else turn * Fraction(CENTURY, unit) ** k for k, turn in enumerate(turns)]
    return out + [Fraction(0)] * (2 - len(out))


def _rows_in_two_parts(rows: Sequence[Sequence[Fraction]]) -> np.ndarray:
    """Return rows of exact numbers as ``[rows, terms, 2]``, each number in two parts; trailing terms that are all zero are left out."""
    terms = max([2, *(k + 1 for row in rows for k, value in enumerate(row) if value)])
    padded = [[*row, *[Fraction(0)] * terms][:terms] for row in rows]
    return np.array([[two_parts(value) for value in row] for row in padded], float).reshape(len(rows), terms, 2)
