"""NAIF ids that SPICE has built in: the centres of its body-fixed frames, and names of bodies that tables are between.

Facts from NAIF's ``frames.req`` and ``naif_ids.req``.
"""

J2000 = 1
INERTIAL = (
    *("J2000", "B1950", "FK4", "DE-118", "DE-96", "DE-102", "DE-108", "DE-111", "DE-114", "DE-122", "DE-125", "DE-130"),
    *("GALACTIC", "DE-200", "DE-202", "MARSIAU", "ECLIPJ2000", "ECLIPB1950", "DE-140", "DE-142", "DE-143"),
)
"""Names of the inertial frames, ids from 1 on."""

SAME_AS_J2000 = ("ICRF", "ICRS", "GCRF", "GCRS", "EME2000")
"""Other names of these axes: SPICE's J2000 is the ICRF, and so is what mission documents that use SPICE call EME2000."""
NO_FRAMES = {
    "TEME": "TEME is the frame of two-line elements (SGP4): true equator of date, mean equinox; it is no frame of SPICE",
    "ECI": "ECI says that axes are inertial and not which: for most orbit data they are 'J2000'; those of two-line elements are TEME",
    "ECEF": "ECEF says that axes turn with the Earth and not how: 'ITRF93' with a binary PCK of the Earth, or 'IAU_EARTH'",
    "MOD": "MOD is the mean equator and equinox of date; it is no frame of SPICE unless a frame kernel defines one",
    "TOD": "TOD is the true equator and equinox of date; it is no frame of SPICE unless a frame kernel defines one",
}
"""Names that are asked for and are no frames of SPICE, with what they mean."""


def same_as_j2000(frame: object) -> bool:
    """Whether a name is another one of the axes J2000."""
    return isinstance(frame, str) and frame.strip().upper() in SAME_AS_J2000


_SATELLITES = {
    **dict(enumerate((401, 402), 10021)),
    **dict(enumerate(range(501, 517), 10023)),
    **dict(enumerate(range(601, 618), 10039)),
    **dict(enumerate(range(701, 716), 10056)),
    **dict(enumerate(range(801, 809), 10071)),
    **dict(enumerate(range(517, 528), 10086)),
}
CENTERS = {
    **dict(enumerate(range(1, 11), 10001)),
    **dict(enumerate(range(199, 1000, 100), 10011)),
    **{10020: 301, 10079: 901, 10081: 399, 10082: 618, 13000: 399},
    **_SATELLITES,
    **{10083: 9511010, 10084: 2431010, 10085: 2000433, 10097: 1000005, 10098: 1000093, 10099: 2000004, 10100: 2025143, 10101: 2000001},
    **{10102: 2000002, 10103: 2000021, 10104: 2000511, 10105: 2002867, 10106: 2101955, 10107: 2000052, 10108: 902, 10109: 903},
    **{10110: 2162173, 10111: 2486958, 10112: 20065803, 10113: 920065803, 10114: 120065803, 10115: 20052246, 10116: 920003548},
    **{10117: 20003548, 10118: 120003548, 10119: 20015094, 10120: 20011351, 10121: 20021900, 10122: 20000617, 10123: 920000617},
    10124: 120000617,
}
"""Id of a body-fixed frame -> id of the body that is its centre."""

_PLANETS = ("MERCURY", "VENUS", "EARTH", "MARS", "JUPITER", "SATURN", "URANUS", "NEPTUNE", "PLUTO")
NAMES = {
    **dict.fromkeys(("SSB", "SOLAR SYSTEM BARYCENTER", "SOLAR_SYSTEM_BARYCENTER"), 0),
    **{f"{planet}{mark}BARYCENTER": i for i, planet in enumerate(_PLANETS, 1) for mark in (" ", "_")},
    **{planet: 100 * i + 99 for i, planet in enumerate(_PLANETS, 1)},
    **dict.fromkeys(("EMB", "EARTH MOON BARYCENTER", "EARTH-MOON BARYCENTER"), 3),
    **{"SUN": 10, "MOON": 301},
}
"""Name of a body, of which one body may have several -> its id."""


def body_named(name: str) -> int | None:
    """Return the id of a body by one of its names, however written, None if it is not among those known here."""
    return NAMES.get(" ".join(name.upper().split()))


def name_of(body: int) -> str:
    """Return a name of a body, or its number as text."""
    return next((name for name, number in NAMES.items() if number == body), str(body))


def labelled(name: str, number: int) -> str:
    """Return a name with its id in brackets, the id alone where it is all the name there is."""
    return name if name == str(number) else f"{name} ({number})"
