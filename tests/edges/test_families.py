"""Edge families as classes: whose constructor they have, which fields are parameters, what constructors refuse."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.errors import EdgeError

E = jf.edges

PARAMETERS = {
    E.Revolute: ("axis", "placement"),
    E.Continuous: ("axis", "placement"),
    E.Prismatic: ("axis", "placement"),
    E.Screw: ("axis", "pitch", "placement"),
    E.Cylindrical: ("axis", "placement"),
    E.Universal: ("axes", "placement"),
    E.PrismaticSpherical: ("axes", "placement"),
    E.Planar: ("axis", "placement"),
    E.Ball: ("placement",),
    E.Free: ("placement",),
    E.Virtual: ("placement",),
    E.Movable: ("pose",),
    E.Prescribed: (),
    E.Attachable: ("pose",),
    E.Mimic: ("edge", "multiplier", "offset"),
}


@pytest.mark.parametrize("family", PARAMETERS, ids=lambda f: f.__name__)
def test_parameters_are_leaves_in_one_order(family):
    assert family.parameter_fields() == PARAMETERS[family]
    edge = family("j", E.Revolute()) if family is E.Mimic else family()
    paths = [path[0].name for path, _ in jax.tree_util.tree_flatten_with_path(edge)[0]]
    assert tuple(dict.fromkeys(paths)) == PARAMETERS[family]


def test_a_family_of_a_family_keeps_the_constructor_that_checks():
    @E.family(static=("active", "limits", "velocity_limits", "effort_limits"))
    class Hinge(E.Revolute):
        """A revolute joint under another name."""

    hinge = Hinge((0, 0, 2), limits=(-1, 1))
    np.testing.assert_array_equal(hinge.axis, [0, 0, 1])
    assert hinge.limits == (-1.0, 1.0)
    with pytest.raises(EdgeError, match="reversed"):
        Hinge(limits=(1, -1))
    assert "hinge about (0, 0, 1)" in repr(hinge)


def test_a_family_without_a_constructor_takes_its_fields():
    @E.family(static=("word",))
    class Wheel(E.Edge):
        radius: jax.Array
        word: str

    @E.family(static=("word",))
    class Cart(Wheel):
        length: jax.Array

    cart = Cart(jnp.ones(1), "cart", jnp.full(1, 2.0))
    assert (float(cart.radius[0]), cart.word, float(cart.length[0])) == (1.0, "cart", 2.0)
    assert Cart.parameter_fields() == ("length", "radius")


def test_a_movable_frame_takes_a_pose():
    with pytest.raises(EdgeError, match=r"Movable takes a jf.Transform, found ndarray; Transform\.from_matrix"):
        E.Movable(np.eye(4))
