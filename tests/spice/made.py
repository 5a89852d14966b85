"""Small kernels written by the tests: Chebyshev segments with numbers of their own."""

import numpy as np
import spiceypy

SEGMENT = "TEST SEGMENT"


def coefficients(rng, records, series, terms, scale=1e5):
    """Random coefficients [records, series, terms] that fall off with the degree, as an ephemeris' do."""
    return rng.normal(size=(records, series, terms)) * scale / 4.0 ** np.arange(terms)


def spk(path, segments):
    """Write segments (type, body, center, frame, begin, end, start of the records, length, coefficients)."""
    handle = spiceypy.spkopn(str(path), "test", 0)
    for kind, body, center, frame, begin, end, start, length, cdata in segments:
        write = {2: spiceypy.spkw02, 3: spiceypy.spkw03}[kind]
        n, _, terms = cdata.shape
        write(handle, body, center, frame, begin, end, SEGMENT, length, n, terms - 1, cdata.reshape(-1), start)
    spiceypy.spkcls(handle)
    return str(path)


def pck(path, segments):
    """Write segments (class id, frame, begin, end, start of the records, length, coefficients)."""
    handle = spiceypy.pckopn(str(path), "test", 0)
    for body, frame, begin, end, start, length, cdata in segments:
        n, _, terms = cdata.shape
        spiceypy.pckw02(handle, body, frame, begin, end, SEGMENT, length, n, terms - 1, cdata.reshape(-1), start)
    spiceypy.pckcls(handle)
    return str(path)


def nodes(path, kind, body, center, epochs, states, degree, frame="J2000", begin=None, end=None):
    """Write an SPK of type 8, 9, 12 or 13 from states [n, 6] in km and km/s."""
    epochs = np.asarray(epochs, float)
    begin, end = epochs[0] if begin is None else begin, epochs[-1] if end is None else end
    handle = spiceypy.spkopn(str(path), "test", 0)
    arguments = (handle, body, center, frame, begin, end, "NODES", degree, len(epochs), states)
    if kind in (8, 12):
        {8: spiceypy.spkw08, 12: spiceypy.spkw12}[kind](*arguments, epochs[0], epochs[1] - epochs[0])
    else:
        {9: spiceypy.spkw09, 13: spiceypy.spkw13}[kind](*arguments, epochs)
    spiceypy.spkcls(handle)
    return str(path)


def states(target, center, times, frame="J2000"):
    """spkez in m and m/s, [n, 6]."""
    return np.array([spiceypy.spkez(target, float(t), frame, "NONE", center)[0] for t in times]) * 1e3
