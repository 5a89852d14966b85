"""No operation of the value types lowers to a matrix product of default precision, derivatives included."""

import inspect

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxframes import spatial as s
from jaxframes.spatial import Motion, Rotation, SpatialAcceleration, SpatialVelocity, Transform, Twist, Wrench
from tests.lowered import assert_highest_precision, products, stages

V, Q, T3 = jnp.array([[0.3, -0.2, 0.5]]), jnp.array([[0.5, 0.5, -0.5, 0.5]]), jnp.ones((1,))
R = Rotation(Q)
POSE = Transform(R, V)
VEL, ACC, TW, WR = SpatialVelocity(V, V), SpatialAcceleration(V, V), Twist(linear=V, angular=V), Wrench(force=V, torque=V)
M = Motion(POSE, VEL, ACC)
VALUES = {"Rotation": R, "Transform": POSE, "SpatialVelocity": VEL, "SpatialAcceleration": ACC, "Twist": TW, "Wrench": WR, "Motion": M}
ANGLES3, PAIR = (T3, T3, T3), (V, V)
ARGUMENTS = {
    **{"Rotation.from_quaternion_wxyz": (Q,), "Rotation.from_quaternion_xyzw": (Q,), "Rotation.from_matrix": (R.to_matrix(),)},
    **{"Rotation.from_rows": (V, V, V), "Rotation.from_columns": (V, V, V), "Rotation.from_two_vectors": PAIR},
    **{"Rotation.from_axis_angle": (V, T3), "Rotation.from_unit_axis_angle": (V, T3), "Rotation.from_rotation_vector": (V,)},
    **{"Rotation.exp": (V,), "Rotation.rot_x": (T3,), "Rotation.rot_y": (T3,), "Rotation.rot_z": (T3,), "Rotation.from_rpy": ANGLES3},
    **{"Rotation.from_euler_zyx": ANGLES3, "Rotation.from_euler_zyz": ANGLES3, "Rotation.distance": (R,), "Rotation.slerp": (R, T3)},
    **{"Rotation.from_euler": ("ZXZ", V), "Rotation.to_euler": ("xyz",), "Rotation.from_mrp": (V,), "Rotation.nearest": (R.to_matrix(),)},
    **{"Rotation.align_vectors": (jnp.eye(3)[None], jnp.eye(3)[None])},
    **{f"Transform.{side}_jacobian{end}": (TW,) for side in ("left", "right") for end in ("", "_inv")},
    **{f"Rotation.rotate_local_{axis}": (T3,) for axis in "xyz"},
    **{f"Rotation.with_unit_{axis}": (V,) for axis in "xyz"},
    **{f"Rotation.{side}_jacobian{end}": (V,) for side in ("left", "right") for end in ("", "_inv")},
    **{"Transform.from_matrix": (POSE.to_matrix(),), "Transform.from_rotation": (R,), "Transform.from_translation": (V,)},
    **{"Transform.from_geodetic": ANGLES3, "Transform.from_dh": (T3, *ANGLES3), "Transform.from_dh_craig1989": (T3, *ANGLES3)},
    **{"Transform.exp": (TW,), "Transform.apply": (V,), "Transform.apply_vector": (V,), "Transform.inverse_apply": (V,)},
    **{"Transform.relative_to": (POSE,), "Transform.retract": (TW,), "Transform.interpolate_screw": (POSE, T3)},
    **{"Transform.interpolate_separate": (POSE, T3), "Transform.reverse_velocity": (VEL,)},
    **{"SpatialVelocity.at_point": (V,), "SpatialVelocity.cross_motion": (VEL,), "SpatialVelocity.cross_force": (WR,)},
    **{f"{name}.from_vector": (jnp.ones((1, 6)),) for name in ("SpatialVelocity", "SpatialAcceleration", "Twist", "Wrench")},
    **{"SpatialAcceleration.at_point": (V, V), "Twist.from_spatial_velocity": (VEL, V), "Twist.to_spatial_velocity": (V,)},
    **{f"{name}.change_base": (R,) for name in ("SpatialVelocity", "SpatialAcceleration", "Twist", "Wrench")},
    **{f"{name}.{method}": (argument,) for name in ("Twist", "Wrench") for method, argument in
       (("ref_point", V), ("transform", POSE), ("inverse_transform", POSE), ("inverse_change_base", R))},
    **{"Twist.dot": (WR,), "Wrench.dot": (TW,), "Motion.at_rest": (POSE,), "Motion.from_point": (V, V, V), "Motion.relative_to": (M,)},
    **{"norm": (V,), "normalize": (V,), "cross": PAIR, "dot": PAIR, "equal": PAIR, "phi": (V,), "allclose": (POSE, POSE)},
    **{"add_delta": (POSE, TW), "diff": (POSE, POSE), "integrate_body_first_order": (POSE, TW, T3)},
}  # fmt: skip
KEYWORDS = {"Motion.spatial_acceleration_featherstone": {"at": "of"}, "Motion.to_oframe_observed": {"x": V, "xdot": V}}
HOST_ONLY = {"identity", "zero", "random", "replace", "astype", "broadcast_to", "reshape", "shape", "ndim", "dtype"}


def surface():
    """Every public function and method of the package, bound to a value where it is a method."""
    kdl = {
        name: thing
        for name, thing in vars(s.kdl).items()
        if not name.startswith("_") and getattr(thing, "__module__", "") == s.kdl.__name__
    }
    for name, thing in sorted({**{k: v for k, v in vars(s).items() if k != "Epoch"}, **kdl}.items()):
        if inspect.isfunction(thing) and name not in ("stack", "concatenate"):
            yield name, thing
        elif inspect.isclass(thing):
            for method in sorted(set(dir(thing)) - HOST_ONLY):
                if not method.startswith("_") and callable(getattr(thing, method)):
                    yield f"{name}.{method}", getattr(VALUES[name], method)


SURFACE = dict(surface())


def test_arguments_fit_the_surface():
    assert set(ARGUMENTS) | set(KEYWORDS) <= set(SURFACE)


def everything(name):
    """Return the function of array leaves only, and those leaves: arguments, and the value the method belongs to."""
    given, keywords = ARGUMENTS.get(name, ()), KEYWORDS.get(name, {})
    words, arguments = (tuple(a for a in given if isinstance(a, str) is text) for text in (True, False))
    owner, _, method = name.rpartition(".")
    bound = owner and inspect.ismethod(SURFACE[name]) and not inspect.isclass(SURFACE[name].__self__)
    value = VALUES[owner] if bound else ()

    def run(value, arguments):
        function = getattr(value, method) if bound else SURFACE[name]
        return jax.tree.leaves(function(*words, *arguments, **keywords))

    return run, value, arguments


def test_every_method(dtype):
    for name in SURFACE:
        run, value, arguments = everything(name)
        assert_highest_precision(run, value, arguments)


@pytest.mark.float64
def test_derivatives():
    for name in ("Rotation.log", "Rotation.from_matrix", "Rotation.mean", "Transform.log", "Motion.inverse", "Motion.rotvec_rates"):
        run, value, arguments = everything(name)

        def total(value, arguments, run=run):
            return sum(jnp.sum(leaf * leaf) for leaf in run(value, arguments))

        assert_highest_precision(jax.grad(total, argnums=(0, 1)), value, arguments)
        assert_highest_precision(
            jax.grad(lambda *a, total=total: sum(map(jnp.sum, jax.tree.leaves(jax.grad(total, (0, 1))(*a))))), value, arguments
        )


def test_operators():
    for a, b in ((R, R), (R, V), (POSE, POSE), (POSE, V), (M, M), (R, TW), (R, ACC), (POSE, WR)):
        assert_highest_precision(lambda a, b: jax.tree.leaves(a @ b), a, b)


def test_the_check_can_fail():
    assert products(lambda a: a @ a, np.eye(3))
    with pytest.raises(AssertionError):
        assert_highest_precision(lambda a: a @ a, np.eye(3))
    assert stages(lambda q: Rotation(q).log(), Q)
    assert not stages(lambda q: Rotation(q).log(), Q, platforms=("cuda",))
