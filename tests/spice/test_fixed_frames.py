"""Frames that do not turn against each other: inertial ones and fixed offsets (TK), against live CSPICE."""

import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors
from tests.spice.test_orientation import angles, matrices

FRAMES = r"""KPL/FK
\begindata
FRAME_MOON_TEST_PA = 1400301
FRAME_1400301_NAME = 'MOON_TEST_PA'
FRAME_1400301_CLASS = 4
FRAME_1400301_CLASS_ID = 1400301
FRAME_1400301_CENTER = 301
TKFRAME_1400301_RELATIVE = 'ITRF93'
TKFRAME_1400301_SPEC = 'ANGLES'
TKFRAME_1400301_UNITS = 'ARCSECONDS'
TKFRAME_1400301_ANGLES = ( 67.573 78.580 0.285 )
TKFRAME_1400301_AXES = ( 3 2 1 )
FRAME_MOON_TEST_ME = 1400302
FRAME_1400302_NAME = 'MOON_TEST_ME'
FRAME_1400302_CLASS = 4
FRAME_1400302_CLASS_ID = 1400302
FRAME_1400302_CENTER = 301
TKFRAME_1400302_RELATIVE = 'MOON_TEST_PA'
TKFRAME_1400302_SPEC = 'MATRIX'
TKFRAME_1400302_MATRIX = ( 0 1 0 -1 0 0 0 0 1 )
FRAME_TILTED = 1400303
FRAME_1400303_NAME = 'TILTED'
FRAME_1400303_CLASS = 4
FRAME_1400303_CLASS_ID = 1400303
FRAME_1400303_CENTER = 0
TKFRAME_1400303_RELATIVE = 'ECLIPJ2000'
TKFRAME_1400303_SPEC = 'QUATERNION'
TKFRAME_1400303_Q = ( 0.5 0.5 0.5 0.5 )
FRAME_UNSAID = 1400304
FRAME_1400304_NAME = 'UNSAID'
FRAME_1400304_CLASS = 4
FRAME_1400304_CLASS_ID = 1400304
FRAME_1400304_CENTER = 0
FRAME_LOOP_A = 1400305
FRAME_1400305_NAME = 'LOOP_A'
FRAME_1400305_CLASS = 4
FRAME_1400305_CLASS_ID = 1400305
FRAME_1400305_CENTER = 0
TKFRAME_1400305_RELATIVE = 'LOOP_B'
TKFRAME_1400305_SPEC = 'MATRIX'
TKFRAME_1400305_MATRIX = ( 1 0 0 0 1 0 0 0 1 )
FRAME_LOOP_B = 1400306
FRAME_1400306_NAME = 'LOOP_B'
FRAME_1400306_CLASS = 4
FRAME_1400306_CLASS_ID = 1400306
FRAME_1400306_CENTER = 0
TKFRAME_1400306_RELATIVE = 'LOOP_A'
TKFRAME_1400306_SPEC = 'MATRIX'
TKFRAME_1400306_MATRIX = ( 1 0 0 0 1 0 0 0 1 )
\begintext
"""


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("fk") / "test.tf"
    path.write_text(FRAMES)
    return path


@pytest.fixture(scope="module")
def framed(paths, file):
    with jf.spice.Kernels([*paths, file]) as opened:
        yield opened


@pytest.mark.parametrize(
    ("frame", "base"),
    [
        ("ECLIPJ2000", "J2000"),
        ("J2000", "J2000"),
        ("GALACTIC", "ECLIPJ2000"),
        ("TILTED", "J2000"),
        ("J2000", "TILTED"),
        ("MOON_TEST_ME", "MOON_TEST_PA"),
        ("MOON_TEST_ME", "ITRF93"),
        ("ITRF93", "MOON_TEST_ME"),
    ],
)
def test_fixed_frames_agree_with_pxform(framed, file, cspice, dtype, frame, base):
    edge = framed.orientation(frame=frame, relative_to=base)
    assert isinstance(edge, jf.edges.Fixed)
    cspice.furnsh(str(file))
    reference = cspice.pxform(frame, base, 8.2e8)
    assert angles(matrices(edge.transform.rotation.wxyz[None]), reference[None]).max() <= (1e-15 if dtype == np.float64 else 3e-7)


def test_a_fixed_offset_from_a_frame_that_turns_makes_two_edges(framed):
    with pytest.raises(errors.NoPathError) as caught:
        framed.orientation(frame="MOON_TEST_ME")
    for part in ("MOON_TEST_ME is fixed to ITRF93, which turns against J2000", "kernels.orientation(frame='ITRF93', relative_to='J2000')"):
        assert part in str(caught.value)


def test_a_base_that_turns(framed):
    with pytest.raises(errors.NoPathError, match=r"relative_to = 'ITRF93' is a PCK frame, which turns.*kernels.tree"):
        framed.orientation(frame="IAU_MARS", relative_to="ITRF93")


def test_offsets_that_are_not_defined_or_run_in_a_circle(framed):
    with pytest.raises(errors.NoPathError, match=r"fixed offset \(TK\) of UNSAID is not fully defined"):
        framed.orientation(frame="UNSAID")
    with pytest.raises(errors.NoPathError, match="LOOP_A -> LOOP_B -> LOOP_A"):
        framed.orientation(frame="LOOP_A")
