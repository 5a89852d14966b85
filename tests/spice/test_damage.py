"""Kernels cut off and with bits flipped, everywhere: an error of the library or the answer that CSPICE gives, never a crash or a hang."""

import threading
from pathlib import Path

import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors
from jaxframes.spice.reading.process import KernelProcess
from tests.spice import made, orbits
from tests.spice.test_process import pool

pytestmark = pytest.mark.float64
REGIONS = {"file record": (0, 1024), "summaries": (1024, 2048), "names": (2048, 3072), "data": (3072, None)}


def write(kind, folder, rng):
    """A small kernel of a kind and the files that it needs: (paths, the damaged one last)."""
    if kind == "CK 3":
        knots = np.arange(0, 301, 10.0)
        return [*orbits.clock(folder), orbits.pointing(folder / "x.bc", 3, knots, *orbits.slew(knots)[:2], starts=[0.0, 150.0])]
    if kind == "PCK 2":
        return [made.pck(folder / "x.bpc", [(3000, "ECLIPJ2000", 0.0, 300.0, 0.0, 100.0, made.coefficients(rng, 3, 3, 7, 0.1))])]
    if kind == "SPK 2":
        return [made.spk(folder / "x.bsp", [(2, -77, 399, "J2000", 0.0, 300.0, 0.0, 60.0, made.coefficients(rng, 5, 3, 7))])]
    return [orbits.nodes(folder / "x.bsp", 13 if kind == "SPK 13" else 9, orbits.LEO, np.arange(0, 601, 20.0), 7, end=300.0)]


def answer(files, kind, timeout=20.0):
    """Make a table of the kernel, the differences from CSPICE on the same file with it; None where CSPICE has no answer."""
    times = np.array([3.0, 77.0, 149.5, 250.0, 299.0])
    with jf.spice.Kernels(files, timeout=timeout) as kernels:
        if kind.startswith("SPK"):
            table = kernels.translation(target=-77, center=399, start=0.0, stop=300.0)
        else:
            table = kernels.orientation(frame="TESTCRAFT" if kind == "CK 3" else "ITRF93", start=0.0, stop=300.0, **mode(kind))
        values = [np.asarray(x) for x in table.evaluate(times)]
        inside = np.asarray(table.coverage_code(times)) == 0
        if not inside.any():
            return table, None
        assert all(np.isfinite(v[inside]).all() for v in values)
        try:
            return table, jf.spice.compare(kernels, table, times[inside])
        except errors.SpiceError:
            return table, None


def mode(kind):
    return {"ck": "spice"} if kind == "CK 3" else {}


def judged(files, kind):
    """Whether a damaged kernel was refused, or gave what CSPICE gives."""
    try:
        table, difference = answer(files, kind)
    except jf.FrameError:
        return "refused"
    if difference is None:
        return "unanswered"
    scale = difference.largest_value if kind.startswith("SPK") else 1.0
    assert difference.value <= 1e-9 * scale, (difference, table.report())
    return "answered"


@pytest.mark.parametrize("kind", ["SPK 2", "SPK 13", "PCK 2", "CK 3"])
def test_flipped_bits_in_every_region(tmp_path, rng, kind):
    files = write(kind, tmp_path, rng)
    content = Path(files[-1]).read_bytes()
    assert answer(files, kind)[1] is not None
    met = []
    for start, stop in REGIONS.values():
        stop = min(stop or len(content), len(content))
        used = start + 96 if start == 0 else start + 160  # the parts of the records that hold something
        for place in [int(rng.integers(start, used)), int(rng.integers(start, stop))][: 2 if kind in ("SPK 13", "CK 3") else 1]:
            damaged = bytearray(content)
            damaged[place] ^= 1 << int(rng.integers(8))
            Path(files[-1]).write_bytes(damaged)
            met.append(judged(files, kind))
    assert "answered" in met


@pytest.mark.parametrize("kind", ["SPK 9", "CK 3"])
def test_files_cut_off_anywhere(tmp_path, rng, kind):
    files = write(kind, tmp_path, rng)
    content = Path(files[-1]).read_bytes()
    for keep in [500, 1024, 2500, 3100, 3072 + (len(content) - 3072) // 4]:
        Path(files[-1]).write_bytes(content[:keep])
        with pytest.raises(jf.FrameError):
            answer(files, kind)


@pytest.mark.parametrize("correction", ["NONE", "CN"])
def test_a_segment_without_records_is_never_fitted(tmp_path, rng, correction):
    # Excerpts of large files may keep summaries whose data they leave out.
    segments = [(2, body, 0, "J2000", 0.0, 3000.0, 0.0, 1000.0, made.coefficients(rng, 3, 3, 7)) for body in (399, -77)]
    path = made.spk(tmp_path / "excerpt.bsp", segments)
    words = np.fromfile(path)
    with jf.spice.Kernels(path) as kernels:
        last = kernels._pool.segments[1].last
    assert words[last - 1] == 3
    words[last - 4 : last] = 0
    words.tofile(path)
    with jf.spice.Kernels(path) as kernels, pytest.raises(errors.BadKernelError, match="it says 0 records of 0 words"):
        kernels.translation(
            target=-77, center=399, start=500.0, stop=2000.0, correction=correction, tolerance=jf.spice.Tolerance(position=1.0)
        )


def test_an_answer_that_does_not_come_ends_the_process(paths):
    process = KernelProcess(timeout=0.5)
    with pytest.raises(errors.BadKernelError, match=r"did not answer within 0.5 s while sleeping.*timeout=seconds"):
        process.call("wait", 60.0, doing="sleeping")
    assert process.closed
    with pytest.raises(errors.SpiceError, match="closed"):
        process.call("version", doing="asking")
    with jf.spice.Kernels(paths[1], timeout=None) as kernels:
        assert kernels._pool.process.call("wait", 0.01, doing="sleeping") is None


def test_the_users_pool_is_untouched_by_errors_and_threads(cspice, tmp_path, rng):
    before = pool(cspice)
    files = write("SPK 13", tmp_path, rng)
    words = np.fromfile(files[-1])
    words[-40:] = np.nan
    words.tofile(files[-1])
    failures = []

    def work():
        try:
            answer(files, "SPK 13")
        except Exception as error:
            failures.append(error)

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [type(error) for error in failures] == [errors.BadKernelError] * 3
    assert len({str(error) for error in failures}) == 1
    assert pool(cspice) == before
    assert not cspice.failed()
