"""Orbits and attitudes whose states and accelerations are known, and kernels written from them."""

import numpy as np
import spiceypy

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
    begin, end = epochs[0] if begin is None else begin, epochs[-1] if end is None else end
    handle = spiceypy.spkopn(str(path), "test", 0)
    arguments = (handle, body, 399, "J2000", begin, end, "NODES", degree, len(epochs), states)
    if kind in (8, 12):
        {8: spiceypy.spkw08, 12: spiceypy.spkw12}[kind](*arguments, epochs[0], epochs[1] - epochs[0])
    else:
        {9: spiceypy.spkw09, 13: spiceypy.spkw13}[kind](*arguments, epochs)
    spiceypy.spkcls(handle)
    return str(path)
