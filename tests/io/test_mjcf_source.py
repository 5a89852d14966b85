"""MJCF from anywhere: no file is read or written that was not named, and what MuJoCo says reaches the caller."""

from types import SimpleNamespace

import mujoco
import pytest

import jaxframes as jf
from jaxframes.errors import FormatError, FrameWarning
from jaxframes.io import mjcf_source

BODY = '<mujoco><worldbody><body name="b" pos="{}"/></worldbody></mujoco>'


@pytest.mark.parametrize(
    ("source", "words"),
    {
        "a name too long": ("9" * 300, "cannot be read: .*File name too long"),
        "half a surrogate pair": ("<mujoco model='\ud800'/>", "the text given is not UTF-8"),
        "no number": (BODY.format("1 nan 2"), "a number in it is none: XML contains a 'NaN'"),
        "bytes": (BODY.format("1 x 2").encode(), "the text given: MuJoCo refuses the model"),
        "another kind": (5, "a path, text, a mujoco.MjSpec or a mujoco.MjModel is needed, found int"),
        "nothing": ("", "is empty; a robot description starts with"),
    }.values(),
)
def test_what_cannot_be_read_is_said_and_leaves_no_file(source, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FormatError, match=words):
        jf.load_mjcf(source)
    assert not list(tmp_path.iterdir())  # MuJoCo's log would be here


def test_text_reads_no_files_and_a_file_its_neighbours(tmp_path):
    """By itself MuJoCo reads what text includes, from anywhere, and shows a part of it in its message."""
    part = tmp_path / "part.xml"
    part.write_text('<mujocoinclude><body name="included"/></mujocoinclude>')
    text = f'<mujoco><worldbody><include file="{part}"/></worldbody></mujoco>'
    with pytest.raises(FormatError, match="includes files, which text may not"):
        jf.load_mjcf(text)
    (tmp_path / "whole.xml").write_text(text.replace(str(part), "part.xml"))
    assert jf.load_mjcf(tmp_path / "whole.xml").names == ("world", "included")


def test_warnings_reach_the_caller_and_the_users_own_listener_stays(monkeypatch):
    listeners = ["the user's"]

    class Spec:
        def compile(self):
            listeners[-1]("a mass is guessed")
            listeners[-1]("a mass is guessed")
            return "a model"

    package = SimpleNamespace(
        MjModel=int, MjSpec=Spec, get_mju_user_warning=lambda: listeners[-1], set_mju_user_warning=lambda one: listeners.append(one)
    )
    monkeypatch.setattr(mjcf_source, "mujoco", lambda: package)
    with pytest.warns(FrameWarning, match="the mujoco.MjSpec given: a mass is guessed") as heard:
        assert mjcf_source.compiled(Spec()) == "a model"
    assert len(heard) == 1
    assert listeners[-1] == "the user's"


def test_mujocos_own_listener_is_as_before():
    before = mujoco.get_mju_user_warning()
    jf.load_mjcf(BODY.format("1 2 3"))
    assert mujoco.get_mju_user_warning() is before
