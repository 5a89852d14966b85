"""Live CSPICE in this process as the oracle, beside tables made by the library's own process."""

import pytest
import spiceypy

import jaxframes as jf

YEAR = ("2026-01-01", "2027-01-01")


@pytest.fixture(scope="session")
def paths():
    return [str(p) for p in jf.spice.find_kernels()]


@pytest.fixture
def cspice(paths):
    """spiceypy with the real kernels loaded, and an empty pool afterwards."""
    for path in paths:
        spiceypy.furnsh(path)
    yield spiceypy
    spiceypy.kclear()


@pytest.fixture(scope="session")
def kernels(paths):
    with jf.spice.Kernels(paths) as opened:
        yield opened


@pytest.fixture(scope="session")
def moon(kernels):
    """The Moon from the Earth in 2026."""
    return kernels.translation(target="MOON", center="EARTH", start=YEAR[0], stop=YEAR[1])


@pytest.fixture(scope="session")
def itrf93(kernels):
    """ITRF93 from J2000 in 2026."""
    return kernels.orientation(frame="ITRF93", start=YEAR[0], stop=YEAR[1])
