"""Orbits and attitudes whose states and accelerations are known, and kernels written from them."""

import numpy as np
import spiceypy

from tests.spice import made

MU = 398600.435507e9
LEO = (6.88e6, 0.001, 0.9)
MOLNIYA = (26.56e6, 0.74, 1.1)


def two_body(orbit, times):
    """Position, velocity and acceleration [n, 3] of a Kepler orbit (semi-major axis, eccentricity, inclination), SI; perigee at 0."""
    a, e, i = orbit
    n = np.sqrt(MU / a**3)
    mean = n * np.asarray(times)
    anomaly = mean + e * np.sin(mean)
    for _ in range(30):
        anomaly = anomaly - (anomaly - e * np.sin(anomaly) - mean) / (1 - e * np.cos(anomaly))
    c, s, b = np.cos(anomaly), np.sin(anomaly), np.sqrt(1 - e * e)
    rate = n / (1 - e * c)
    plane = np.array([[1, 0, 0], [0, np.cos(i), np.sin(i)]])
    position = (a * np.stack([c - e, b * s], -1)) @ plane
    velocity = (a * rate[:, None] * np.stack([-s, b * c], -1)) @ plane
    return position, velocity, -MU * position / np.linalg.norm(position, axis=1)[:, None] ** 3


def nodes(path, kind, orbit, times, degree, body=-77, origin=0.0, begin=None, end=None):
    """Write an SPK of type 8, 9, 12 or 13 from an orbit about the Earth; epochs are origin + times."""
    position, velocity, _ = two_body(orbit, times)
    states, epochs = np.concatenate([position, velocity], 1) / 1e3, origin + np.asarray(times)
    return made.nodes(path, kind, body, 399, epochs, states, degree, begin=begin, end=end)


def slew(times, amplitude=3e-4):
    """Attitude quaternions o_T_p [n, 4], angular velocities and accelerations [n, 3] in o axes of a slow wandering slew."""
    return _from_angles(np.asarray(times), ((1.0, amplitude), (0.7, 0.8 * amplitude), (0.4, 1.3 * amplitude)))


def _from_angles(t, waves):
    """Turns about z, x and z by angles sin(k t) / k scaled, composed with their exact derivatives."""
    q, w, a = np.tile([1.0, 0, 0, 0], (len(t), 1)), np.zeros((len(t), 3)), np.zeros((len(t), 3))
    for (phase, rate), axis in zip(waves, np.eye(3)[[2, 0, 2]], strict=True):
        k = rate / (1.0 + phase)
        angle, angle1, angle2 = phase + rate / k * np.sin(k * t), rate * np.cos(k * t), -rate * k * np.sin(k * t)
        q, w, a = _turn(q, w, a, axis, angle, angle1, angle2)
    return q, w, a


def spinner(times, rpm=4.0, wobble=0.05):
    """A spinner that nutates: attitude, angular velocity and acceleration as in ``slew``."""
    t = np.asarray(times)
    n = rpm * 2 * np.pi / 60
    q, w, a = np.tile([1.0, 0, 0, 0], (len(t), 1)), np.zeros((len(t), 3)), np.zeros((len(t), 3))
    for axis, angle, rate in ((2, 0.3 * n * t, 0.3 * n), (0, np.full(len(t), wobble), 0.0), (2, 0.7 * n * t, 0.7 * n)):
        q, w, a = _turn(q, w, a, np.eye(3)[axis], angle, np.full(len(t), rate), np.zeros(len(t)))
    return q, w, a


def _turn(q, w, a, axis, angle, rate, rate2):
    """One more turn about an axis of the frame reached so far."""
    from jaxframes.numerics import host_quaternions

    axis = host_quaternions.rotate(q, np.broadcast_to(axis, w.shape))
    spin = axis * rate[:, None]
    a = a + axis * rate2[:, None] + np.cross(w, spin)
    q = host_quaternions.multiply(host_quaternions.from_rotation_vector(axis * angle[:, None]), q)
    return q, w + spin, a


SCLK = """KPL/SCLK
\\begindata
SCLK_KERNEL_ID = ( @2026-01-01 )
SCLK_DATA_TYPE_77 = ( 1 )
SCLK01_TIME_SYSTEM_77 = ( {system} )
SCLK01_N_FIELDS_77 = ( 2 )
SCLK01_MODULI_77 = ( 4294967296 65536 )
SCLK01_OFFSETS_77 = ( 0 0 )
SCLK01_OUTPUT_DELIM_77 = ( 1 )
SCLK_PARTITION_START_77 = ( 0.0 )
SCLK_PARTITION_END_77 = ( 2.8147497671065E+14 )
SCLK01_COEFFICIENTS_77 = ( {coefficients} )
\\begintext
"""
FK = """KPL/FK
\\begindata
FRAME_TESTCRAFT = -77000
FRAME_-77000_NAME = 'TESTCRAFT'
FRAME_-77000_CLASS = 3
FRAME_-77000_CLASS_ID = -77000
FRAME_-77000_CENTER = -77
CK_-77000_SCLK = -77
CK_-77000_SPK = -77
\\begintext
"""


def clock(folder, origin=0.0, rate=1.0, system=1, later=()):
    """Write a clock kernel (65536 ticks a count) and a frame kernel; ``later`` holds more (counts, seconds, rate)."""
    rows = [(0, origin, rate), *((c * 65536, s, r) for c, s, r in later)]
    text = "\n".join(f"{float(t)!r} {float(s)!r} {float(r)!r}" for t, s, r in rows)
    (folder / "test.tsc").write_text(SCLK.format(system=system, coefficients=text))
    (folder / "test.tf").write_text(FK)
    return [str(folder / "test.tsc"), str(folder / "test.tf")]


def pointing(path, kind, seconds, q, w, starts=None, rates=True, base="J2000", append=()):
    """Write a C-kernel of type 1, 2 or 3: seconds of the clock's counts, poses o_T_p, angular velocities; ``append`` more of the same."""
    handle = spiceypy.ckopn(str(path), "test", 0)
    for counts, poses, spins, begins in ((seconds, q, w, starts), *append):
        ticks = np.asarray(counts) * 65536.0
        spice = poses * np.array([1.0, -1, -1, -1])
        ends = (handle, ticks[0], ticks[-1], -77000, base)
        if kind == 2:
            n = len(ticks) - 1
            spiceypy.ckw02(*ends, "SPIN", n, ticks[:-1], ticks[1:], spice[:-1], spins[:-1], np.full(n, 1 / 65536))
        elif kind == 1:
            spiceypy.ckw01(*ends, rates, "POINTS", len(ticks), ticks, spice, spins)
        else:
            first = np.asarray([counts[0]] if begins is None else begins) * 65536.0
            spiceypy.ckw03(*ends, rates, "KNOTS", len(ticks), ticks, spice, spins, len(first), first)
    spiceypy.ckcls(handle)
    return str(path)
