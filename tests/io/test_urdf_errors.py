"""Broken robot descriptions: each refused within a second, with the file, the element and the remedy."""

import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import jaxframes as jf
from jaxframes import errors


def robot(body):
    return f'<?xml version="1.0"?>\n<robot name="r">\n{body}\n</robot>\n'


LINKS = '<link name="a"/>\n<link name="b"/>\n<link name="c"/>\n'


def joint(name="j", kind="fixed", parent="a", child="b", more=""):
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{more}</joint>\n'


LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
C = joint("k", child="c")
REVOLUTE = joint(kind="revolute", more=LIMIT)
BOMB = (
    '<?xml version="1.0"?>\n<!DOCTYPE lolz [<!ENTITY a "lol">'
    + "".join(f'<!ENTITY {chr(98 + i)} "{("&" + chr(97 + i) + ";") * 10}">' for i in range(9))
    + ']>\n<robot name="&j;"><link name="a"/></robot>'
)

BROKEN = {
    "missing link": (robot(LINKS + joint(child="bb") + C), errors.UnknownFrameError, ["line 6", "'j'", "'bb'", "Did you mean 'b'"]),
    "missing parent link": (robot(LINKS + joint(parent="z") + C), errors.UnknownFrameError, ["'j'", "parent link 'z'"]),
    "two parents": (robot(LINKS + joint() + C + joint("m", parent="c")), errors.TopologyError, ["'b'", "'m'", "'j'", "line 6", "remove"]),
    "cycle": (
        robot(LINKS + joint("j", parent="b", child="c") + joint("k", parent="c", child="b")),
        errors.TopologyError,
        ["'j'", "'k'", "cycle"],
    ),
    "cycle of all": (
        robot('<link name="a"/><link name="b"/>' + joint() + joint("k", parent="b", child="a")),
        errors.TopologyError,
        ["cycle"],
    ),
    "two roots": (robot(LINKS + joint()), errors.TopologyError, ["2 links", "'a'", "'c'", "line 5", "connect"]),
    "own parent": (robot(LINKS + joint(child="a")), errors.TopologyError, ["'a'", "itself"]),
    "unknown type": (robot(LINKS + joint(kind="revolut") + C), errors.FormatError, ["'revolut'", "Did you mean 'revolute'", "line 6"]),
    "no type": (robot(LINKS + joint().replace(' type="fixed"', "") + C), errors.FormatError, ["'j'", "'type'", "missing"]),
    "zero axis": (robot(LINKS + joint(kind="continuous", more='<axis xyz="0 0 0"/>') + C), errors.EdgeError, ["'j'", "zero", "'0 0 1'"]),
    "axis of two": (
        robot(LINKS + joint(kind="continuous", more='<axis xyz="0 1"/>') + C),
        errors.FormatError,
        ["<axis>", "2 numbers where 3"],
    ),
    "no number": (robot(LINKS + joint(more='<origin xyz="0 one 0"/>') + C), errors.FormatError, ["<origin>", "'one'", "line 6"]),
    "nan": (robot(LINKS + joint(more='<origin rpy="0 nan 0"/>') + C), errors.FormatError, ["'nan'", "finite"]),
    "overflow": (robot(LINKS + joint(more='<origin xyz="0 0 1e999"/>') + C), errors.FormatError, ["'1e999'", "finite"]),
    "underscore": (robot(LINKS + joint(more='<origin xyz="0 0 1_0"/>') + C), errors.FormatError, ["'1_0'"]),
    "second link of a name": (robot(LINKS + '<link name="a"/>' + joint() + C), errors.DuplicateNameError, ["'a'", "line 3", "rename"]),
    "second joint of a name": (robot(LINKS + joint() + joint(child="c")), errors.DuplicateNameError, ["'j'", "line 6"]),
    "second origin": (robot(LINKS + joint(more="<origin/><origin/>") + C), errors.FormatError, ["second <origin>"]),
    "mimic of itself": (
        robot(LINKS + joint(kind="revolute", more=LIMIT + '<mimic joint="j"/>') + C),
        errors.TopologyError,
        ["'j'", "j -> j"],
    ),
    "mimic in a ring": (
        robot(
            LINKS
            + joint(kind="revolute", more=LIMIT + '<mimic joint="k"/>')
            + joint("k", "revolute", child="c", more=LIMIT + '<mimic joint="j"/>')
        ),
        errors.TopologyError,
        ["j -> k -> j"],
    ),
    "mimic of nobody": (
        robot(LINKS + joint(kind="revolute", more=LIMIT + '<mimic joint="q"/>') + C),
        errors.UnknownJointError,
        ["'q'", "mimic=False"],
    ),
    "mimic of a fixed joint": (
        robot(LINKS + joint(kind="revolute", more=LIMIT + '<mimic joint="k"/>') + C),
        errors.EdgeError,
        ["'k'", "fixed"],
    ),
    "mimic without a joint": (
        robot(LINKS + joint(kind="revolute", more=LIMIT + "<mimic/>") + C),
        errors.FormatError,
        ["<mimic>", "joint="],
    ),
    "mimic of a floating joint": (
        robot(LINKS + joint(kind="revolute", more=LIMIT + '<mimic joint="k"/>') + joint("k", "floating", child="c")),
        errors.EdgeError,
        ["'j'", "'k'", "quaternion"],
    ),
    "quaternion beside angles": (
        robot(LINKS + joint(more='<origin rpy="0 0 1" quat_xyzw="0 0 0 1"/>') + C),
        errors.FormatError,
        ["<origin>", "'rpy'", "'quat_xyzw'", "keep one"],
    ),
    "quaternion off unit": (
        robot(LINKS + joint(more='<origin quat_xyzw="0 0 1 1"/>') + C),
        errors.FormatError,
        ["quat_xyzw='0 0 1 1'", "length 1.41421", "unit"],
    ),
    "attribute of an origin": (robot(LINKS + joint(more='<origin rotation="0 0 1"/>') + C), errors.FormatError, ["<origin>", "'rotation'"]),
    "attribute of an axis": (
        robot(LINKS + joint(kind="continuous", more='<axis xyz="0 0 1" rpy="0 0 1"/>') + C),
        errors.FormatError,
        ["<axis>", "'rpy'"],
    ),
    "attribute of a mimic": (
        robot(LINKS + joint(kind="revolute", more=LIMIT + '<mimic joint="k" multiplyer="2"/>') + joint("k", "continuous", child="c")),
        errors.FormatError,
        ["<mimic>", "'multiplyer'", "Did you mean 'multiplier'"],
    ),
    "attribute of a joint": (robot(LINKS + joint().replace("<joint", '<joint axis="0 0 1"') + C), errors.FormatError, ["'j'", "'axis'"]),
    "attribute of a parent": (
        robot(LINKS + joint().replace('"a"/>', '"a" xyz="1 0 0"/>', 1) + C),
        errors.FormatError,
        ["<parent>", "'xyz'"],
    ),
    "element of an origin": (
        robot(LINKS + joint(more="<origin><xyz>0 0 1</xyz></origin>") + C),
        errors.FormatError,
        ["<xyz>", "<origin> holds no elements"],
    ),
    "misspelled element": (robot(LINKS + joint(more='<orgin xyz="1 0 0"/>') + C), errors.FormatError, ["<orgin>", "<origin>"]),
    "misspelled limit": (
        robot(LINKS + REVOLUTE.replace("upper", "uper") + C),
        errors.FormatError,
        ["<limit>", "'uper'", "Did you mean 'upper'"],
    ),
    "infinite limit": (
        robot(LINKS + REVOLUTE.replace('"-1"', '"-inf"') + C),
        errors.FormatError,
        ["lower='-inf'", "'continuous'", "1e300"],
    ),
    "infinite slide": (
        robot(LINKS + joint(kind="prismatic", more=LIMIT.replace('"1"', '"Infinity"', 1)) + C),
        errors.FormatError,
        ["upper='Infinity'", "1e300"],
    ),
    "joint of others": (
        robot(LINKS + joint().replace("joint", "drake:joint").replace("fixed", "ball") + C),
        errors.TopologyError,
        ["2 links", "<drake:joint name='j' type='ball'> of line 6", "is not read"],
    ),
    "missing limit": (robot(LINKS + joint(kind="revolute") + C), errors.FormatError, ["'j'", "<limit", "continuous"]),
    "limits reversed": (robot(LINKS + REVOLUTE.replace('"-1"', '"2"') + C), errors.EdgeError, ["<limit>", "'j'", "reversed", "lower 2"]),
    "no parent": (robot(LINKS + joint().replace('<parent link="a"/>', "") + C), errors.FormatError, ["'j'", "<parent>", "add"]),
    "parent without a link": (robot(LINKS + joint().replace('<parent link="a"/>', "<parent/>") + C), errors.FormatError, ["names no link"]),
    "link without a name": (robot("<link/>"), errors.FormatError, ["<link>", "'name'", "missing"]),
    "empty name": (robot('<link name=""/>'), errors.FormatError, ["'name'", "empty"]),
    "no links": (robot(""), errors.FormatError, ["<robot", "no <link>"]),
    "truncated": (robot(LINKS + joint())[:70], errors.FormatError, ["line", "too soon", "whole"]),
    "truncated between elements": (robot(LINKS)[:-12], errors.FormatError, ["too soon", "<robot>"]),
    "mismatched tags": ("<robot><link name='a'></robot>", errors.FormatError, ["line 1", "mismatched", "<link>"]),
    "other root": ("<model name='m'/>", errors.FormatError, ["<model", "<robot>"]),
    "mjcf": ("<mujoco model='m'/>", errors.FormatError, ["load_mjcf"]),
    "sdf": ("<sdf version='1.6'/>", errors.FormatError, ["SDF"]),
    "xacro macro": (robot('<xacro:macro name="m"/>'), errors.FormatError, ["line 3", "xacro", "expand"]),
    "xacro expression": (robot(LINKS + joint(more='<origin xyz="0 ${pi} 0"/>') + C), errors.FormatError, ["${pi}", "xacro"]),
    "xacro name": (robot('<link name="${prefix}a"/>'), errors.FormatError, ["xacro"]),
    "doctype": ('<!DOCTYPE robot><robot name="r"><link name="a"/></robot>', errors.FormatError, ["line 1", "DOCTYPE", "remove"]),
    "entity bomb": (BOMB, errors.FormatError, ["line 2", "DOCTYPE"]),
    "external entity": ('<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/hosts">]><robot name="&x;"/>', errors.FormatError, ["DOCTYPE"]),
    "unknown entity": (robot('<link name="&what;"/>'), errors.FormatError, ["line 3", "undefined entity"]),
    "empty": ("", errors.FormatError, ["empty", "<robot"]),
    "blank": (" \n\t ", errors.FormatError, ["empty"]),
    "binary": (b"\x7fELF\x02\x01\x01\x00\x00", errors.FormatError, ["binary"]),
    "bad encoding": (b"<?xml version='1.0' encoding='klingon'?><robot/>", errors.FormatError, ["encoding"]),
    "nested too deeply": ("<robot>" + "<x>" * 5000, errors.FormatError, ["nested", "200"]),
    "100 MB": (lambda: b"<robot>" + b" " * 100_000_000, errors.FormatError, ["bytes", "more than"]),
    "no text at all": (3, errors.FormatError, ["int", "path or text"]),
    "no such file": ("nowhere/robot.urdf", errors.FormatError, ["'nowhere/robot.urdf'", "no file", "'<'"]),
    "a folder": (".", errors.FormatError, ["folder"]),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_text_is_refused_with_place_and_remedy(case):
    source, error, words = BROKEN[case]
    source = source() if callable(source) else source
    start = time.perf_counter()
    with pytest.raises(error) as caught:
        jf.load_urdf(source)
    assert time.perf_counter() - start < 1.0
    assert isinstance(caught.value, jf.FrameError)
    for word in words:
        assert word in str(caught.value), str(caught.value)


@pytest.mark.parametrize("case", ["limits reversed", "zero axis", "own parent", "mimic of a floating joint"])
def test_messages_say_where_once(case, tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(BROKEN[case][0])
    with pytest.raises(jf.FrameError) as caught:
        jf.load_urdf(path)
    assert str(caught.value).count("arm.urdf") == 1, str(caught.value)


def test_quaternions_of_urdf_1_1_are_read(tol):
    # the first is the issue's own; scipy reads the second's angles
    half = joint(more='<origin xyz="1 0 0" quat_xyzw="0 0 0.7071067811865476 0.7071067811865476"/>')
    rpy = Rotation.from_euler("xyz", [0.1, -0.7, 2.0])
    other = joint("k", child="c", more=f'<origin quat_xyzw="{" ".join(f"{v:.4f}" for v in rpy.as_quat())}"/>')
    tree = jf.load_urdf(robot(LINKS + half + other))
    expected = [[0, -1, 0, 1], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    np.testing.assert_allclose(tree.edge("b").transform.to_matrix(), expected, atol=tol)
    np.testing.assert_allclose(tree.edge("c").transform.rotation.to_matrix(), rpy.as_matrix(), atol=2e-4)
    np.testing.assert_allclose(np.linalg.norm(tree.edge("c").transform.rotation.wxyz), 1.0, atol=tol)
    again = jf.load_urdf(jf.to_urdf(tree))
    for name in ("b", "c"):
        np.testing.assert_allclose(again.edge(name).transform.to_matrix(), tree.edge(name).transform.to_matrix(), atol=tol)


def test_attributes_that_move_nothing_are_counted():
    text = robot('<link name="a" group="1"/><link name="b"/>' + joint(kind="revolute", more=LIMIT[:-2] + ' current="3"/>')).replace(
        '<robot name="r"', '<robot name="r" version="1.1" xmlns:xacro="somewhere" maker="us"'
    )
    text = text.replace("<joint", '<joint dont_collapse="true"')
    assert jf.load_urdf(text).properties["a"]["ignored"] == {"robot/@maker": 1, "link/@group": 1, "joint/limit/@current": 1}


@pytest.mark.parametrize("case", ["missing link", "truncated", "entity bomb", "binary", "empty", "xacro macro"])
def test_errors_of_files_name_the_file(case, tmp_path):
    source = BROKEN[case][0]
    path = tmp_path / "arm.urdf"
    path.write_bytes(source if isinstance(source, bytes) else source.encode())
    with pytest.raises(jf.FrameError, match=r"arm\.urdf"):
        jf.load_urdf(path)
    with pytest.raises(jf.FrameError, match=r"arm\.urdf"):
        jf.load_urdf(str(path))


def test_a_huge_file_is_refused_without_reading_it(tmp_path):
    path = tmp_path / "huge.urdf"
    with path.open("wb") as file:
        file.seek(100_000_000)
        file.write(b">")
    start = time.perf_counter()
    with pytest.raises(errors.FormatError, match="100000001 bytes"):
        jf.load_urdf(path)
    assert time.perf_counter() - start < 1.0


def test_text_may_come_in_other_encodings_and_with_a_mark():
    text = '<robot name="r"><link name="größe"/></robot>'
    for source in ("\ufeff" + text, text.encode("utf-16"), text.encode("utf-8-sig"), text):
        assert jf.load_urdf(source).names == ("größe",)


def every_kind():
    axis = '<axis xyz="0 0 2"/>'
    kinds = [
        joint("free", "floating", "base", "body"),
        joint("table", "planar", "body", "sled", '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="2" velocity="3"/>'),
        joint("turn", "revolute", "sled", "arm", axis + LIMIT + '<dynamics damping="0.5"/>'),
        joint("spin", "continuous", "arm", "disc", axis + '<limit effort="5" velocity="7"/>'),
        joint("push", "prismatic", "disc", "rod", '<origin xyz="0 0 1" rpy="0 1.5707963267948966 0.3"/>' + LIMIT),
        joint("copy", "revolute", "rod", "hand", axis + LIMIT + '<mimic joint="turn" multiplier="-2" offset="0.5"/>'),
        joint("copy2", "continuous", "hand", "nail", axis + '<mimic joint="copy"/>'),
        joint("glue", "fixed", "nail", "dot", '<mimic joint="turn"/><mystery/>'),
    ]
    links = ["base", "body", "sled", "arm", "disc", "rod", "hand", "nail", "dot"]
    return jf.load_urdf(robot("".join(f'<link name="{n}"/>' for n in links) + "".join(kinds) + "<gazebo/><gazebo/>"))


def test_every_joint_type_becomes_its_edge():
    tree = every_kind()
    kinds = {name: type(tree.edge(tree.frame_of(name))).__name__ for name in ("free", "table", "turn", "spin", "push", "copy", "glue")}
    assert kinds == {
        **{"free": "Free", "table": "Planar", "turn": "Revolute", "spin": "Continuous"},
        **{"push": "Prismatic", "copy": "Mimic", "glue": "Fixed"},
    }
    assert tree.joint_names == ("free", "table", "turn", "spin", "push")
    assert (tree.nq, tree.nv) == (13, 12)
    assert tree.properties["base"]["ignored"] == {"gazebo": 2, "joint/mystery": 1}
    assert tree.properties["arm"]["joint"]["dynamics"]["damping"] == 0.5
    np.testing.assert_array_equal(tree.edge("disc").velocity_limits, [7])
    state = tree.state(q={"turn": 0.3})
    np.testing.assert_allclose(tree.get_q(state, "copy2"), [-0.1], rtol=1e-5)


def test_every_joint_type_survives_the_round_trip():
    tree = every_kind()
    again = jf.load_urdf(jf.to_urdf(tree))
    assert (again.names, again.joint_names) == (tree.names, tree.joint_names)
    assert dict(again.properties["sled"]) == dict(tree.properties["sled"])
    for frame in tree.names[1:]:
        assert again.edge(frame).describe() == tree.edge(frame).describe()


def test_trees_of_other_origin_are_written_where_urdf_can_say_them():
    b = jf.TreeBuilder(root="base")
    b.add("a", parent="base", edge=jf.edges.Revolute((1, 2, 3), jf.Transform(jf.Rotation.from_rpy(0.1, np.pi / 2, 0.3), np.ones(3))))
    b.add("b", parent="a", edge=jf.edges.Prismatic((0, 1, 0), limits=(-np.inf, 0.5)))
    b.add("c", parent="b", edge=jf.edges.Fixed())
    tree = b.build()
    again = jf.load_urdf(jf.to_urdf(tree, name="mine"))
    assert again.properties["base"]["robot"] == "mine"
    assert type(again.edge("a")).__name__ == "Continuous"
    np.testing.assert_array_equal(again.edge("b").limits, tree.edge("b").limits)
    np.testing.assert_allclose(again.edge("a").placement.to_matrix(), tree.edge("a").placement.to_matrix(), atol=1e-6)
    assert again.joint_of("c") == "c_joint"
    for edge in (jf.edges.Ball(), jf.edges.Prescribed(), jf.edges.Screw(pitch=1.0)):
        b = jf.TreeBuilder(root="base")
        b.add("odd", parent="base", edge=edge)
        with pytest.raises(errors.FormatError, match="'odd'"):
            jf.to_urdf(b.build())


def test_numbers_are_read_in_linear_time():
    """A pattern with two ways to match a digit takes half an hour for these."""
    joint = '<joint name="j" type="fixed"><origin xyz="{} 0 0"/><parent link="a"/><child link="b"/></joint>'
    text = f'<robot name="r"><link name="a"/><link name="b"/>{joint}</robot>'
    with pytest.raises(jf.FrameError, match=r"'1{60}'\.\.\. \(300001 characters\) is no finite number") as found:
        jf.load_urdf(text.format("1" * 300_000 + "x"))
    assert len(str(found.value)) < 500
    tree = jf.load_urdf(text.format("0." + "3" * 300_000))
    assert abs(float(tree.edge("b").transform.translation[0]) - 1 / 3) < 1e-7
