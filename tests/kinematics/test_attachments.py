"""Frames that change parents: against RobWork's results, a model with explicit parents, loops and finite differences."""

import functools
import json
from pathlib import Path

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors
from tests.random_trees import unit

GOLDEN = json.loads((Path(__file__).parent.parent / "data" / "robwork.json").read_text())["cases"]


def transform_of(entry):
    return jf.Transform(jf.Rotation.from_matrix(np.array(entry["R"])), np.array(entry["P"]))


def arm_scene(candidates=None, chained=2):
    b = jf.TreeBuilder(root="world")
    b.add("table", parent="world", edge=jf.edges.Fixed(jf.Transform.from_translation((0.5, 0.0, 0.2))))
    b.add("j1", parent="world", edge=jf.edges.Revolute(axis=(0, 0, 1), placement=jf.Transform.from_translation((0.0, 0.0, 0.4))))
    b.add("j2", parent="j1", edge=jf.edges.Revolute(axis=(0, 1, 0), placement=jf.Transform.from_translation((0.3, 0.0, 0.1))))
    b.add("hand", parent="j2", edge=jf.edges.Fixed(jf.Transform(jf.Rotation.from_rpy(0.1, 0.2, 0.3), np.array([0.4, 0.0, 0.0]))))
    b.add("box", parent="table", edge=jf.edges.Attachable(jf.Transform.from_translation((0.1, 0.1, 0.0)), candidates=candidates))
    b.add("lid", parent="box", edge=jf.edges.Fixed(jf.Transform.from_translation((0.0, 0.0, 0.1))))
    if chained > 1:
        b.add("note", parent="lid", edge=jf.edges.Attachable(jf.Transform.from_translation((0.02, 0.0, 0.0))))
    return b.build()


@pytest.mark.float64
@pytest.mark.parametrize("case", [c for c in GOLDEN if c["fn"].startswith("scene.")], ids=lambda c: c["id"])
def test_robwork_scenes(case):
    given = {k: (transform_of(v) if isinstance(v, dict) else v) for k, v in case["in"].items()}
    b = jf.TreeBuilder(root="world")
    b.add("base", parent="world", edge=jf.edges.Fixed(given["base"]))
    b.add("j1", parent="base", edge=jf.edges.Revolute(axis=(0, 0, 1), placement=given["j1"]))
    b.add("j2", parent="j1", edge=jf.edges.Prismatic(axis=(0, 0, 1), placement=given["j2"]))
    b.add("tool", parent="j2", edge=jf.edges.Fixed(given["tool"]))
    b.add("table", parent="world", edge=jf.edges.Fixed(given["table"]))
    b.add("item", parent="table", edge=jf.edges.Attachable(given["item_rel"]))
    b.add("peg", parent="item", edge=jf.edges.Attachable(given["peg"]))
    tree = b.build()
    first = next(c["in"] for c in GOLDEN if c["id"] == "scene.initial" + case["id"][-2:])  # "then_move" lists the joint after the move
    state = tree.state(q=[*first["q1"], *first["q2"]])
    if "attachTo" in case["fn"]:
        state = tree.attach(state, "item", "tool")
    elif "gripFrame" in case["fn"]:
        state = tree.attach(state, "item", "tool", keep="world")
    if "then_move" in case["fn"]:
        state = tree.set_q(state, {"j1": given["q1"][0]})
    for name in ("tool", "item", "peg"):
        pose, theirs = tree.transform(state, of=name, relative_to="world"), case["out"][f"wT{name}"]
        np.testing.assert_allclose(pose.rotation.to_matrix(), theirs["R"], atol=1e-12)
        np.testing.assert_allclose(pose.translation, theirs["P"], atol=1e-12)


def test_attachable_says_what_robwork_says_of_its_frames_but_for_the_root():
    tree = arm_scene()
    assert [tree.is_attachable(n) for n in ("world", "box", "note", "hand")] == [False, True, True, False]
    state = tree.state()
    assert tree.parent("box", state) == "table"
    gripped = tree.attach(state, "box", "hand")
    assert tree.parent("box", gripped) == "hand"
    assert tree.parent("box") == "table"
    assert tree.children("hand", gripped) == ("box",)
    assert tree.children("table", gripped) == ()
    assert tree.attached_to(gripped) == {"box": "hand", "note": "lid"}
    assert tree.attached_to(tree.detach(gripped, "box"))["box"] == "world"
    assert tree.attached_to(state)["box"] == "table"


@pytest.mark.parametrize(
    ("frame", "to", "error", "words"),
    [
        ("hand", "table", errors.EdgeError, ["'hand'", "'table'", "'j2'", "Attachable"]),
        ("world", "table", errors.EdgeError, ["'world'", "'table'", "root"]),
        ("box", 2.0, errors.ShapeError, ["'box'", "2.0", "integers"]),
        ("box", "box", errors.TopologyError, ["'box'", "itself"]),
        ("box", "lid", errors.TopologyError, ["'box'", "'lid'", "cycle"]),
        ("box", "note", errors.TopologyError, ["'box'", "'note'", "cycle"]),
        ("box", "tabel", errors.UnknownFrameError, ["'tabel'", "'table'"]),
        ("bx", "table", errors.UnknownFrameError, ["'bx'", "'box'"]),
        ("box", 99, errors.TopologyError, ["'box'", "99"]),
    ],
)
def test_refusals_name_both_frames_and_change_nothing(frame, to, error, words):
    tree = arm_scene()
    state = tree.state()
    before = jax.tree.map(np.array, state)
    with pytest.raises(error) as caught:
        tree.attach(state, frame, to)
    for word in words:
        assert word in str(caught.value)
    chex.assert_trees_all_equal(before, jax.tree.map(np.array, state))


def test_refusals_while_building():
    b = jf.TreeBuilder()
    b.add("a", parent="world", edge=jf.edges.Attachable(candidates=("world", "nowhere")))
    with pytest.raises(errors.UnknownFrameError, match="'nowhere'"):
        b.build()
    b = jf.TreeBuilder()
    b.add("a", parent="world", edge=jf.edges.Attachable(candidates=("world", "b")))
    b.add("b", parent="a", edge=jf.edges.Fixed())
    with pytest.raises(errors.TopologyError, match="cycle"):
        b.build()
    b = jf.TreeBuilder()
    b.add("x", parent="world", edge=jf.edges.Fixed())
    b.add("a", parent="world", edge=jf.edges.Attachable(candidates=("x",)))
    with pytest.raises(errors.TopologyError, match="starts on 'world'"):
        b.build()


class Model:
    """Explicit parents and 4x4 poses: what the tree should be equal to."""

    def __init__(self, tree, state):
        self.tree, self.parent, self.local, self.q = tree, {}, {}, np.zeros(2)
        for name in tree.names[1:]:
            self.parent[name] = tree.parent(name)
            self.local[name] = np.asarray(tree.transform(state, of=name, relative_to=tree.parent(name)).to_matrix(), np.float64)
        self.rest = {name: self.local[name] for name in ("j1", "j2")}

    def move(self, q):
        for name, value, axis in (("j1", q[0], 2), ("j2", q[1], 1)):
            turn, (i, j) = np.eye(4), [(1, 2), (2, 0), (0, 1)][axis]
            turn[i, i] = turn[j, j] = np.cos(value)
            turn[j, i], turn[i, j] = np.sin(value), -np.sin(value)
            self.local[name] = self.rest[name] @ turn

    def world(self, name):
        return np.eye(4) if name == "world" else self.world(self.parent[name]) @ self.local[name]

    def hangs_on(self, name, ancestor):
        while name != "world":
            if name == ancestor:
                return True
            name = self.parent[name]
        return False

    def attach(self, name, to, keep):
        if keep == "world":
            self.local[name] = np.linalg.inv(self.world(to)) @ self.world(name)
        self.parent[name] = to


def test_ten_thousand_operations_agree_with_the_model(rng, dtype):
    tree = arm_scene()
    state = tree.state()
    model, tree_names = Model(tree, state), tree.names
    attach = {
        (name, keep): jax.jit(lambda s, to, name=name, keep=keep: tree.attach(s, name, to, keep=keep))
        for name in ("box", "note")
        for keep in ("relative", "world")
    }

    def put_down(state, wxyz, place, name):
        pose = jf.Transform(jf.Rotation.from_quaternion_wxyz(wxyz), place)
        return tree.set_motion(state, name, pose), pose.to_matrix()

    put = jax.jit(put_down, static_argnames="name")
    matrices = jax.jit(lambda s: tree.world_transforms(s).to_matrix())
    count, refused, bound = (10_000, 0, 1e-11) if dtype == np.float64 else (300, 0, 2e-3)
    for i in range(count):
        if rng.random() < 0.3:
            q = rng.uniform(-3, 3, 2)
            model.move(q)
            state = state.replace(q=q.astype(dtype))
        elif rng.random() < 0.15:  # put down anew: repeated relative attachments onto each other would amplify any rounding
            name, wxyz, place = ("box", "note")[rng.integers(2)], unit(rng, 4), rng.normal(size=3)
            state, matrix = put(state, wxyz.astype(dtype), place.astype(dtype), name=name)
            model.local[name] = np.asarray(matrix, np.float64)
        else:
            name, to = ("box", "note")[rng.integers(2)], tree_names[rng.integers(len(tree_names))]
            keep = "world" if rng.random() < 0.8 else "relative"
            if model.hangs_on(to, name):
                refused += 1
                with pytest.raises(errors.TopologyError):
                    tree.attach(state, name, to, keep=keep)
                continue
            state = attach[name, keep](state, np.int32(tree.topology.index(to)))
            model.attach(name, to, keep)
        if i % 10 == 0 or i == count - 1:
            mine = np.asarray(matrices(state))
            for name in ("hand", "lid", "note"):
                theirs = model.world(name)
                assert np.abs(mine[tree.topology.index(name)] - theirs).max() <= bound * max(1.0, np.abs(theirs).max()), (i, name)
    assert refused > count // 50


def graph_tree(count):
    b = jf.TreeBuilder(root="world")
    b.add("base", parent="world", edge=jf.edges.Revolute(axis=(1, 2, 3)))
    rng = np.random.default_rng(1)
    for i in range(count):
        pose = jf.Transform(jf.Rotation.from_quaternion_wxyz(unit(rng, 4)), rng.normal(size=3))
        b.add(f"part{i}", parent="base", edge=jf.edges.Attachable(pose))
        b.add(f"tip{i}", parent=f"part{i}", edge=jf.edges.Fixed(jf.Transform.from_translation((0.1, 0.2, 0.3))))
    return b.build()


def random_graphs(rng, tree, rows, count, cyclic):
    """Parents [rows, count]: chains up to depth ``count``; some rows get a cycle."""
    parts = [tree.topology.index(f"part{i}") for i in range(count)]
    tips = [tree.topology.index(f"tip{i}") for i in range(count)]
    parents, bad = np.zeros((rows, count), np.int32), np.zeros((rows, count), bool)
    for r in range(rows):
        order = rng.permutation(count)
        for place, i in enumerate(order):
            above = order[rng.integers(place)] if place and rng.random() < 0.85 else None
            parents[r, i] = rng.integers(2) if above is None else (parts, tips)[rng.integers(2)][above]
        if cyclic and rng.random() < 0.3:
            i, j = rng.choice(count, 2, replace=False)
            parents[r, i], parents[r, j] = parts[j], tips[i]
        owner = {**dict(zip(parts, range(count), strict=True)), **dict(zip(tips, range(count), strict=True))}
        for i in range(count):
            at, steps = i, 0
            while at is not None and steps <= count:
                at, steps = owner.get(int(parents[r, at])), steps + 1
            bad[r, i] = at is not None
    return parents, bad


def test_a_batch_of_random_graphs_equals_the_loop_and_cycles_spoil_only_their_own(rng, dtype, tol):
    count, rows = 8, 4096
    tree = graph_tree(count)
    parents, bad = random_graphs(rng, tree, rows, count, cyclic=True)
    assert bad.any()
    assert not bad.all()
    q = rng.normal(size=(rows, 1)).astype(dtype)  # NumPy: the loop below takes its rows
    base = tree.state()

    def ask(q, parents):
        state = base.replace(q=q, attachments=jf.Attachments(parents, base.attachments.motion))
        poses = tree.transforms_between(state, of=[f"tip{i}" for i in range(count)], relative_to=["world"])
        return poses.to_matrix()[0, :, :3], tree.attachments_valid(state)

    batch, valid = jax.jit(jax.vmap(ask))(q, parents)
    one = jax.jit(ask)
    batch = np.asarray(batch)
    np.testing.assert_array_equal(np.isnan(batch).any((-1, -2)), bad)
    np.testing.assert_array_equal(valid, ~bad.any(-1))
    local = np.asarray(base.attachments.motion.transform.to_matrix(), np.float64)
    axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    tip = np.eye(4)
    tip[:3, 3] = 0.1, 0.2, 0.3
    names = tree.names
    looped = [jax.device_get(one(q[r], parents[r])) for r in range(rows)]
    np.testing.assert_allclose(np.stack([pose for pose, _ in looped]), batch, atol=50 * tol)
    np.testing.assert_array_equal([flag for _, flag in looped], valid)
    for r in range(0, rows, 17):
        turn = np.eye(4)
        angle = float(q[r, 0])
        turn[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross

        def world(name, r=r, turn=turn):
            if name == "world":
                return np.eye(4)
            if name == "base":
                return turn
            i = int(name[-1])
            return world("part" + name[-1]) @ tip if name.startswith("tip") else world(names[parents[r, i]]) @ local[i]

        for i in range(count):
            if not bad[r, i]:
                np.testing.assert_allclose(batch[r, i], world(f"tip{i}")[:3], atol=100 * tol)


@pytest.mark.float64
def test_queries_agree_with_the_equivalent_static_tree(dtype, tol):
    tree = arm_scene()
    state = tree.state(q=[0.4, -0.8], qd=[0.5, 0.2], qdd=[-0.3, 0.9])
    gripped = jax.jit(lambda s: tree.attach(s, "box", "hand", keep="world"))(state)
    static = tree.reattached(state, "box", "hand", keep="world")
    still = static.state(q=state.q, qd=state.qd, qdd=state.qdd)

    def ask(tree, state):
        pairs = (("lid", "table"), ("table", "lid"), ("lid", "hand"), ("hand", "box"))
        motions = [tree.motion(state, of=of, relative_to=relative_to) for of, relative_to in pairs]
        jacobian = tree.jacobian(state, of="lid", relative_to="table")
        return [(m.transform.to_matrix(), jax.tree.leaves(m)[2:]) for m in motions], jacobian

    for a, b in zip(*(jax.tree.leaves(jax.jit(ask)(*given)) for given in ((tree, gripped), (static, still))), strict=True):
        np.testing.assert_allclose(a, b, atol=20 * tol)


def test_keep_motion_keeps_velocity_and_acceleration(dtype, tol):
    tree = arm_scene()
    state = tree.state(q=[0.4, -0.8], qd=[0.5, 0.2], qdd=[-0.3, 0.9])

    @jax.jit
    def ask(state):
        gripped = tree.attach(state, "box", "hand", keep="world")
        released, dropped = (tree.detach(gripped, "box", keep=keep) for keep in ("motion", "world"))
        before, after = (tree.motion(s, of="lid", relative_to="world") for s in (gripped, released))
        return before, after, tree.velocity(dropped, of="lid", relative_to="world").as_vector()

    before, after, at_rest = ask(state)
    for a, b in zip(jax.tree.leaves(after), jax.tree.leaves(before), strict=True):
        np.testing.assert_allclose(a, b, atol=20 * tol)
    assert not np.any(at_rest)
    assert np.abs(before.velocity.linear).max() > 0.05


def pick_and_place(tree, qs, switches):
    """Scan over joint values; ``switches`` holds the index that the box is attached to at every step."""

    def step(state, x):
        q, to = x
        state = tree.attach(state.replace(q=q), "box", to, keep="world")
        return state, tree.transform(state, of="lid", relative_to="world").translation

    return jax.lax.scan(step, tree.state(q=qs[0]), (qs, switches))


def test_gradient_through_fifty_steps_of_pick_and_place(rng, dtype):
    tree = arm_scene(candidates=("table", "hand", "world"), chained=1)
    index = tree.topology.index
    steps = 50
    switches = jnp.asarray([index("table")] * 10 + [index("hand")] * 25 + [index("world")] * 15, jnp.int32)
    qs = jnp.asarray(np.cumsum(rng.normal(size=(steps, 2)) * 0.1, axis=0), dtype)
    final = jax.jit(lambda qs: jnp.sum(pick_and_place(tree, qs, switches)[1][-1] * jnp.asarray([1.0, -2.0, 0.5], dtype)))
    gradient = np.asarray(jax.jit(jax.grad(final))(qs))
    assert np.isfinite(gradient).all()
    assert np.abs(gradient[10]).max() > 1e-2  # the joints at the grasp and at the release decide where the box ends
    assert np.abs(gradient[35]).max() > 1e-2 or np.abs(gradient[34]).max() > 1e-2
    if dtype == np.float64:
        for i in range(steps):
            for j in range(2):
                h = 1e-6
                change = float(final(qs.at[i, j].add(h)) - final(qs.at[i, j].add(-h))) / (2 * h)
                assert abs(change - gradient[i, j]) <= 1e-8 * max(1.0, abs(change)), (i, j)


def test_a_new_parent_never_retraces():
    chex.clear_trace_counter()
    tree = arm_scene()

    @jax.jit
    @chex.assert_max_traces(n=1)
    def grip(state, to):
        return tree.attach(state, "box", to, keep="world")

    state = tree.state()
    for name in ("hand", "table", "world", "j1"):
        state = grip(state, jnp.asarray(tree.topology.index(name), jnp.int32))
        assert tree.parent("box", state) == name


def test_check_names_cycles_and_strange_parents():
    tree = arm_scene()
    index = tree.topology.index
    state = tree.state()
    parents = jnp.asarray([[index("table"), index("lid")], [index("note"), index("lid")], [77, index("lid")]], jnp.int32)
    wrong = tree.check(state.replace(attachments=jf.Attachments(parents, state.attachments.motion)))
    assert any("'box'" in line and "77" in line and "index 2" in line for line in wrong)
    moved = state.replace(attachments=jf.Attachments(parents[:2], state.attachments.motion))
    assert any("'note'" in line and "cycle" in line and "index 1" in line for line in tree.check(moved))


def test_a_bad_link_spoils_no_gradient_of_a_good_one(dtype):
    tree = arm_scene(chained=2)
    index = tree.topology.index
    state = tree.attach(tree.state(q=[0.3, 0.2]), "box", "hand")
    tangled = jnp.asarray([index("hand"), index("note")], jnp.int32)  # the note hangs on itself, the box does not
    state = state.replace(attachments=jf.Attachments(tangled, state.attachments.motion))

    @functools.partial(jax.jit, static_argnames="of")
    def place(q, of):
        return tree.transform(state.replace(q=q), of=of, relative_to="world").translation[0]

    good = jax.jit(jax.grad(lambda q: place(q, "lid")))(state.q)
    h, limit = (1e-6, 1e-9) if dtype == np.float64 else (1e-3, 1e-3)
    for i in range(2):
        ends = [float(place(state.q.at[i].add(s * h), "lid")) for s in (1, -1)]
        assert abs(float(good[i]) - (ends[0] - ends[1]) / (2 * h)) < limit
    assert np.isnan(place(state.q, "note"))


def test_a_state_of_another_tree_is_refused():
    tree, other = arm_scene(), arm_scene(chained=1)
    for ask in (
        lambda s: tree.transform(s, of="box", relative_to="hand"),
        lambda s: tree.attach(s, "box", "hand"),
        tree.attached_to,
        lambda s: tree.parent("box", s),
    ):
        for state in (other.state(), tree.state().replace(attachments=None)):
            with pytest.raises(errors.ShapeError, match="attach"):
                ask(state)
    assert any("attachments" in line for line in tree.check(tree.state().replace(attachments=None)))


def test_text_and_check_follow_the_state():
    tree = arm_scene()
    state = tree.attach(tree.state(), "box", "hand")
    shown = tree.format(state=state).splitlines()
    hand = next(i for i, line in enumerate(shown) if "hand" in line)
    assert "box" in shown[hand + 1]
    facts = tree.describe(state, of="lid", relative_to="world")
    assert facts["frames"] == ("world", "j1", "j2", "hand", "box", "lid")
    assert facts["transform"].translation.shape == (3,)
    assert "pointer doubling" in tree.explain(of="lid", relative_to="world")
    assert "+1  hand -> box" in tree.explain(of="lid", relative_to="world", state=state)
    bad = tree.set_motion(state, "box", jf.Transform(jf.Rotation(np.array([2.0, 0, 0, 0])), np.array([np.nan, 0, 0])))
    assert any("'box'" in line and "not finite" in line for line in tree.check(bad))
    batch = jax.tree.map(lambda x: jnp.stack([x, x]), state)
    with pytest.raises(errors.ShapeError, match="'hand'"):
        tree.children("hand", batch)


def test_default_candidates_keep_their_precision_far_from_the_root(dtype):
    b = jf.TreeBuilder(root="sun")
    b.add("craft", parent="sun", edge=jf.edges.Prescribed())
    b.add("arm", parent="craft", edge=jf.edges.Prismatic(axis=(1, 0, 0)))
    b.add("load", parent="craft", edge=jf.edges.Attachable())
    b.add("tag", parent="load", edge=jf.edges.Fixed())
    tree = b.build()
    state = tree.set_motion(tree.state(q=[3.0]), "craft", jf.Transform.from_translation((1.5e11, 0.0, 0.0)))
    held = tree.attach(state, "load", "arm")
    for of, relative_to, expected in (("load", "craft", 3.0), ("craft", "tag", -3.0)):
        assert float(tree.transform(held, of=of, relative_to=relative_to).translation[0]) == expected
    gripped = tree.attach(held, "load", "craft", keep="world")
    assert float(tree.transform(gripped, of="tag", relative_to="arm").translation[0]) == 0.0


def test_near_candidates_keep_their_precision_far_from_the_root(dtype):
    b = jf.TreeBuilder(root="sun")
    b.add("craft", parent="sun", edge=jf.edges.Prescribed())
    b.add("arm", parent="craft", edge=jf.edges.Prismatic(axis=(1, 0, 0)))
    b.add("bay", parent="craft", edge=jf.edges.Fixed())
    b.add("load", parent="bay", edge=jf.edges.Attachable(candidates=("bay", "arm")))
    tree = b.build()
    state = tree.set_motion(tree.state(q=[3.0]), "craft", jf.Transform.from_translation((1.5e11, 0.0, 0.0)))
    held = tree.attach(state, "load", "arm")
    assert float(tree.transform(held, of="load", relative_to="bay").translation[0]) == 3.0


def test_moving_a_frame_looks_at_what_hangs_on_it_in_this_state(tol):
    """Whether an observer moves along is a question to the state: what it was declared on says nothing."""
    b = jf.TreeBuilder(root="world")
    b.add("cart", parent="world", edge=jf.edges.Movable(jf.Transform.from_translation((1.0, 0.0, 0.0))))
    b.add("shelf", parent="cart", edge=jf.edges.Fixed(jf.Transform.from_translation((0.0, 0.0, 0.5))))
    b.add("cup", parent="shelf", edge=jf.edges.Attachable(jf.Transform.from_translation((0.0, 0.1, 0.0))))
    b.add("spoon", parent="world", edge=jf.edges.Attachable(jf.Transform.from_translation((3.0, 0.0, 0.0))))
    tree = b.build()
    goal, state = jf.Transform.from_translation((0.0, 2.0, 0.0)), tree.state()
    with pytest.raises(errors.TopologyError, match="which hangs on it"):
        tree.move_to(state, "cart", goal, relative_to="cup")
    away = tree.attach(state, "cup", "world", keep="world")
    moved = tree.move_to(away, "cart", goal, relative_to="cup")
    np.testing.assert_allclose(tree.transform(moved, of="cart", relative_to="cup").translation, goal.translation, atol=10 * tol)
    aboard = tree.attach(state, "spoon", "cup")  # by way of another attachable frame
    with pytest.raises(errors.TopologyError, match="which hangs on it"):
        tree.move_to(aboard, "cart", goal, relative_to="spoon")

    @jax.jit
    def placed(parent):
        held = tree.attach(away, "spoon", parent, keep="world")
        return tree.move_to(held, "cart", goal, relative_to="spoon").prescribed.transform.translation

    index = tree.topology.index
    assert np.isnan(placed(index("shelf"))).all()
    np.testing.assert_allclose(placed(index("cup"))[0], [3.0, 2.0, 0.0], atol=10 * tol)


def test_derivatives_by_a_whole_state(dtype):
    b = jf.TreeBuilder(root="world")
    b.add("arm", parent="world", edge=jf.edges.Revolute(axis=(0, 0, 1)))
    b.add("box", parent="world", edge=jf.edges.Attachable(jf.Transform.from_translation((1.0, 0.0, 0.0))))
    tree = b.build()
    state = tree.attach(tree.state(q=np.array([0.3], dtype)), "box", "arm")
    assert state.attachments.parents.dtype == np.int32
    y = lambda s: tree.transform(s, of="box", relative_to="world").translation[1]
    c, s = np.cos(0.3), np.sin(0.3)
    for slope in (jax.grad(y), jax.jit(jax.grad(y)), jax.jacfwd(y)):
        found = slope(state)
        np.testing.assert_allclose(found.q, [c], rtol=1e-6)
        np.testing.assert_allclose(found.attachments.motion.transform.translation, [[s, c, 0.0]], atol=1e-7)
        np.testing.assert_array_equal(found.attachments.links, [0.0])
    stepped = jax.tree.map(lambda leaf, slope: leaf - 0.1 * slope, state, jax.grad(y)(state))  # what an optimiser does
    np.testing.assert_array_equal(stepped.attachments.parents, state.attachments.parents)
    np.testing.assert_allclose(stepped.q, 0.3 - 0.1 * c, rtol=1e-6)
    curved = jax.jit(jax.hessian(lambda q: y(state.replace(q=q))))(state.q)
    np.testing.assert_allclose(curved, [[-s]], rtol=1e-5)
    lost = state.replace(attachments=jf.Attachments(jnp.full(1, jnp.nan), state.attachments.motion))
    np.testing.assert_array_equal(lost.attachments.parents, [-1])
    assert np.isnan(y(lost))
