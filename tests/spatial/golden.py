"""What each function of the golden files is in jaxframes: name -> function of the inputs, batched, giving the outputs as recorded.

Rates (VectorVel, FrameVel, TwistVel) are taken by forward-mode differentiation of the plain functions along the motion given, so
the golden rates check derivatives as well.
"""

import json
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes import spatial as s
from jaxframes.spatial import Motion, Rotation, SpatialAcceleration, SpatialVelocity, Transform, Twist, Wrench

DATA = Path(__file__).parent.parent / "data"


def load(name):
    """Return the cases of a golden file as {function: [case, ...]}."""
    groups = {}
    for case in json.loads((DATA / name).read_text())["cases"]:
        groups.setdefault(case["fn"], []).append(case)
    return groups


def stacked(cases, key):
    """Return the inputs or outputs of several cases as one tree of arrays with a leading axis."""
    values = [case["ideal"] if key == "out" and "ideal" in case else case[key] for case in cases]
    return stack_trees(values)


def stack_trees(values):
    if isinstance(values[0], dict):
        return {name: stack_trees([v[name] for v in values]) for name in values[0] if name != "made_from"}
    return np.array(values, dtype=bool if isinstance(values[0], bool) else float)


def rot(m):
    return Rotation.from_matrix(m)


def mat(r):
    return r.to_matrix()


def pose(f):
    return Transform(rot(f["M"]), f["p"])


def unpose(t):
    return {"M": mat(t.rotation), "p": t.translation}


def twist(t):
    return Twist(linear=t["vel"], angular=t["rot"])


def untwist(t):
    return {"vel": t.linear, "rot": t.angular}


def wrench(w):
    return Wrench(force=w["force"], torque=w["torque"])


def unwrench(w):
    return {"force": w.force, "torque": w.torque}


def rpy_zyx(angles):
    return jnp.stack(angles, -1)


def rotangle(r):
    angle, axis = rot(r).to_axis_angle()
    return {"angle": angle, "axis": axis}


def normalized(a):
    unit, length = s.kdl.normalize(a)
    return {"norm": length, "vec": unit}


# ---------------------------------------------------------------------- rates, by differentiation along the motion
def along(function, *pairs):
    """Return the value and rate of a function of quantities given as functions of time, at time zero."""
    return jax.jvp(lambda t: function(*(pair(t) for pair in pairs)), (jnp.zeros(()),), (jnp.ones(()),))


def moving(v):
    return lambda t: v["p"] + t * v["v"]


def turning(r):
    return lambda t: Rotation.exp(jnp.asarray(r["w"]) * t) @ rot(r["R"])


def posing(f):
    return lambda t: Transform(turning(f["M"])(t), moving(f["p"])(t))


def twisting(t):
    linear, angular = moving(t["vel"]), moving(t["rot"])
    return lambda time: Twist(linear=linear(time), angular=angular(time))


def pair(result):
    return {"p": result[0], "v": result[1]}


def twist_pair(result):
    value, rate = result
    return {"vel": {"p": value.linear, "v": rate.linear}, "rot": {"p": value.angular, "v": rate.angular}}


def motion(f):
    """Return a FrameVel as a Motion without acceleration."""
    zero = SpatialAcceleration(jnp.zeros_like(f["M"]["w"]), jnp.zeros_like(f["M"]["w"]))
    return Motion(Transform(rot(f["M"]["R"]), f["p"]["p"]), SpatialVelocity(f["M"]["w"], f["p"]["v"]), zero)


def unmotion(m):
    pose_, v = m.transform, m.velocity
    return {"M": {"R": mat(pose_.rotation), "w": v.angular}, "p": {"p": pose_.translation, "v": v.linear}}


def turn_rate(maker, axis):
    def function(angle, rate):
        r = maker(angle)
        return {"R": mat(r), "w": rate * jnp.eye(3)[axis]}

    return function


def local_rate(method, axis):
    def function(A, angle, rate):
        before = rot(A["R"])
        after = getattr(before, method)(angle)
        return {"R": mat(after), "w": A["w"] + before @ (rate * jnp.eye(3)[axis])}

    return function


def diff_framevel(a, b, dt):
    """Return diff of the frames and diff of their velocities: KDL pairs the two, though the second is no derivative of the first."""
    value = s.kdl.diff(Transform(rot(a["M"]["R"]), a["p"]["p"]), Transform(rot(b["M"]["R"]), b["p"]["p"]), dt)
    rate = Twist(linear=s.kdl.diff(a["p"]["v"], b["p"]["v"], dt), angular=s.kdl.diff(a["M"]["w"], b["M"]["w"], dt))
    return twist_pair((value, rate))


PYKDL = {
    "Vector.add": lambda a, b: a + b,
    "Vector.sub": lambda a, b: a - b,
    "Vector.neg": lambda a: -a,
    "Vector.ReverseSign": lambda a: -a,
    "Vector.scale": lambda a, s: a * s,
    "Vector.div": lambda a, s: a / s,
    "Vector.cross": lambda a, b: s.kdl.cross(a, b),
    "Vector.default": lambda: jnp.zeros(3),
    "Vector.Zero": lambda: jnp.zeros(3),
    "Vector.Normalize": lambda a: normalized(a),
    "Vector.Norm": lambda a: s.kdl.norm(a),
    "Vector.Norm_eps0": lambda a: s.kdl.norm(a),
    "dot.vector": lambda a, b: s.kdl.dot(a, b),
    "Equal.vector": lambda a, b, eps: s.kdl.equal(a, b, eps),
    "Vector.eq_operator": lambda a, b: s.kdl.equal(a, b),
    "Rotation.default": lambda: mat(Rotation.identity()),
    "Rotation.Identity": lambda: mat(Rotation.identity()),
    "Rotation.RotX": lambda angle: mat(Rotation.rot_x(angle)),
    "Rotation.RotY": lambda angle: mat(Rotation.rot_y(angle)),
    "Rotation.RotZ": lambda angle: mat(Rotation.rot_z(angle)),
    "Rotation.Rot": lambda axis, angle: mat(Rotation.from_axis_angle(axis, angle)),
    "Rotation.Rot2": lambda axis, angle: mat(Rotation.from_unit_axis_angle(axis, angle)),
    "Rotation.EulerZYZ": lambda z1, y, z2: mat(Rotation.from_euler_zyz(z1, y, z2)),
    "Rotation.RPY": lambda r, p, y: mat(Rotation.from_rpy(r, p, y)),
    "Rotation.EulerZYX": lambda z, y, x: mat(Rotation.from_euler_zyx(z, y, x)),
    "Rotation.Quaternion": lambda xyzw: mat(Rotation.from_quaternion_xyzw(xyzw)),
    "Rotation.DoRotX": lambda R, angle: mat(rot(R).rotate_local_x(angle)),
    "Rotation.DoRotY": lambda R, angle: mat(rot(R).rotate_local_y(angle)),
    "Rotation.DoRotZ": lambda R, angle: mat(rot(R).rotate_local_z(angle)),
    "Rotation.Inverse": lambda R: mat(rot(R).inverse()),
    "Rotation.SetInverse": lambda R: mat(rot(R).inverse()),
    "Rotation.UnitX": lambda R: rot(R).unit_x(),
    "Rotation.UnitY": lambda R: rot(R).unit_y(),
    "Rotation.UnitZ": lambda R: rot(R).unit_z(),
    "Rotation.mul": lambda A, B: mat(rot(A) @ rot(B)),
    "Rotation.mul_vector": lambda R, v: rot(R) @ v,
    "Rotation.mul_twist": lambda R, t: untwist(rot(R) @ twist(t)),
    "Rotation.mul_wrench": lambda R, w: unwrench(rot(R) @ wrench(w)),
    "Rotation.inv_vector": lambda R, v: rot(R).inverse() @ v,
    "Rotation.inv_twist": lambda R, t: untwist(twist(t).inverse_change_base(rot(R))),
    "Rotation.inv_wrench": lambda R, w: unwrench(wrench(w).inverse_change_base(rot(R))),
    "Rotation.GetRPY": lambda R: rpy_zyx(rot(R).to_rpy()),
    "Rotation.GetEulerZYX": lambda R: rpy_zyx(rot(R).to_euler_zyx()),
    "Rotation.GetEulerZYZ": lambda R: rpy_zyx(rot(R).to_euler_zyz()),
    "Rotation.GetQuaternion": lambda R: rot(R).to_quaternion_xyzw(),
    "Rotation.GetRot": lambda R: rot(R).to_rotation_vector(),
    "Rotation.GetRotAngle": lambda R: rotangle(R),
    "Rotation.GetRotAngle_eps": lambda R, eps: rotangle(R),
    "Frame.Identity": lambda: unpose(Transform.identity()),
    "Frame.default": lambda: unpose(Transform.identity()),
    "Frame.ctor_rot_pos": lambda R, p: unpose(Transform(rot(R), p)),
    "Frame.ctor_rot": lambda R: unpose(Transform.from_rotation(rot(R))),
    "Frame.ctor_pos": lambda p: unpose(Transform.from_translation(p)),
    "Frame.getitem": lambda F: pose(F).to_matrix()[..., :3, :],
    "Frame.Inverse": lambda F: unpose(pose(F).inverse()),
    "Frame.mul": lambda A, B: unpose(pose(A) @ pose(B)),
    "Frame.mul_vector": lambda F, v: pose(F) @ v,
    "Frame.mul_twist": lambda F, t: untwist(pose(F) @ twist(t)),
    "Frame.mul_wrench": lambda F, w: unwrench(pose(F) @ wrench(w)),
    "Frame.inv_vector": lambda F, v: pose(F).inverse_apply(v),
    "Frame.inv_twist": lambda F, t: untwist(twist(t).inverse_transform(pose(F))),
    "Frame.inv_wrench": lambda F, w: unwrench(wrench(w).inverse_transform(pose(F))),
    "Frame.Integrate": lambda F, t, freq: unpose(s.kdl.integrate_body_first_order(pose(F), twist(t), 1 / freq)),
    "Frame.DH": lambda a, alpha, d, theta: unpose(Transform.from_dh(a, alpha, d, theta)),
    "Frame.DH_Craig1989": lambda a, alpha, d, theta: unpose(Transform.from_dh_craig1989(a, alpha, d, theta)),
    "diff.rotation": lambda a, b, dt: s.kdl.diff(rot(a), rot(b), dt),
    "diff.vector": lambda a, b, dt: s.kdl.diff(a, b, dt),
    "diff.frame": lambda a, b, dt: untwist(s.kdl.diff(pose(a), pose(b), dt)),
    "diff.twist": lambda a, b, dt: untwist(s.kdl.diff(twist(a), twist(b), dt)),
    "diff.wrench": lambda a, b, dt: unwrench(s.kdl.diff(wrench(a), wrench(b), dt)),
    "addDelta.frame": lambda F, t, dt: unpose(s.kdl.add_delta(pose(F), twist(t), dt)),
    "addDelta.rotation": lambda R, w, dt: mat(s.kdl.add_delta(rot(R), w, dt)),
    "addDelta.vector": lambda v, dv, dt: s.kdl.add_delta(v, dv, dt),
    "addDelta.twist": lambda a, da, dt: untwist(s.kdl.add_delta(twist(a), twist(da), dt)),
    "addDelta.wrench": lambda a, da, dt: unwrench(s.kdl.add_delta(wrench(a), wrench(da), dt)),
    "Twist.RefPoint": lambda t, v: untwist(twist(t).ref_point(v)),
    "Wrench.RefPoint": lambda w, v: unwrench(wrench(w).ref_point(v)),
    "dot.twist_wrench": lambda t, w: twist(t).dot(wrench(w)),
    "dot.wrench_twist": lambda w, t: wrench(w).dot(twist(t)),
    "Twist.Zero": lambda: untwist(Twist.zero()),
    "Wrench.Zero": lambda: unwrench(Wrench.zero()),
    "Twist.add": lambda a, b: untwist(twist(a) + twist(b)),
    "Twist.sub": lambda a, b: untwist(twist(a) - twist(b)),
    "Twist.neg": lambda a: untwist(-twist(a)),
    "Twist.ReverseSign": lambda a: untwist(-twist(a)),
    "Twist.scale": lambda a, s: untwist(twist(a) * s),
    "Twist.div": lambda a, s: untwist(twist(a) / s),
    "Wrench.add": lambda a, b: unwrench(wrench(a) + wrench(b)),
    "Wrench.sub": lambda a, b: unwrench(wrench(a) - wrench(b)),
    "Wrench.neg": lambda a: unwrench(-wrench(a)),
    "Wrench.ReverseSign": lambda a: unwrench(-wrench(a)),
    "Wrench.scale": lambda a, s: unwrench(s * wrench(a)),
    "Wrench.div": lambda a, s: unwrench(wrench(a) / s),
    "FrameVel.mul": lambda A, B: unmotion(motion(A) @ motion(B)),
    "FrameVel.Inverse": lambda A: unmotion(motion(A).inverse()),
    "FrameVel.GetFrame": lambda A: unpose(motion(A).transform),
    "FrameVel.mul_vectorvel": lambda A, v: pair(along(lambda f, x: f @ x, posing(A), moving(v))),
    "FrameVel.inv_vectorvel": lambda A, v: pair(along(lambda f, x: f.inverse_apply(x), posing(A), moving(v))),
    "FrameVel.mul_twistvel": lambda A, t: twist_pair(along(lambda f, x: f @ x, posing(A), twisting(t))),
    "FrameVel.mul_twist": lambda A, t: twist_pair(along(lambda f: f @ twist(t), posing(A))),
    "RotationVel.mul_vectorvel": lambda A, v: pair(along(lambda r, x: r @ x, turning(A), moving(v))),
    "VectorVel.cross": lambda a, b: pair(along(s.kdl.cross, moving(a), moving(b))),
    "VectorVel.Norm": lambda a: jnp.stack(along(s.kdl.norm, moving(a)), -1),
    "TwistVel.RefPoint": lambda t, v: twist_pair(along(lambda x, d: x.ref_point(d), twisting(t), moving(v))),
    "RotationVel.RotX": turn_rate(Rotation.rot_x, 0),
    "RotationVel.RotY": turn_rate(Rotation.rot_y, 1),
    "RotationVel.RotZ": turn_rate(Rotation.rot_z, 2),
    "RotationVel.DoRotX": local_rate("rotate_local_x", 0),
    "RotationVel.DoRotY": local_rate("rotate_local_y", 1),
    "RotationVel.DoRotZ": local_rate("rotate_local_z", 2),
    "FrameVel.GetTwist": lambda A: untwist(Twist.from_spatial_velocity(motion(A).velocity, jnp.zeros(3))),
    "FrameVel.chain": lambda A, B, C: unmotion(motion(A).inverse() @ motion(B) @ motion(C)),
    "diff.framevel": diff_framevel,
    "Twist.index": lambda a: jnp.concatenate([twist(a).linear, twist(a).angular]),
    "Wrench.index": lambda a: jnp.concatenate([wrench(a).force, wrench(a).torque]),
}
"""Every function of pykdl.json whose result ours must equal; the others have tests of their own in test_golden.py."""
