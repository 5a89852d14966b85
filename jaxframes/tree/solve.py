"""Solving a composition o -> m -> p for one of its parts, when the whole and the other part are known."""

from jaxframes.numerics.components import V3, Quat, cross, quat_conj, rotate
from jaxframes.numerics.lift import lift
from jaxframes.spatial import Motion, SpatialAcceleration, SpatialVelocity, Transform


def transform(whole: Transform, rest: Transform, first: bool) -> Transform:
    """Return the first part's pose from the second's (``rest``), or the second's from the first's."""
    return whole @ rest.inverse() if first else rest.inverse() @ whole


def velocity(whole: SpatialVelocity, sub: Transform, rest_pose: Transform, rest: SpatialVelocity, first: bool) -> SpatialVelocity:
    """Return the velocity of the first or the second part."""
    if first:
        made = _first_velocity(sub.rotation.wxyz, rest_pose.translation, whole.angular, whole.linear, rest.angular, rest.linear)
    else:
        made = _second_velocity(rest_pose.rotation.wxyz, sub.translation, whole.angular, whole.linear, rest.angular, rest.linear)
    return SpatialVelocity(*made)


def acceleration(
    whole: SpatialAcceleration, sub: Transform, sub_velocity: SpatialVelocity, rest: Motion, first: bool
) -> SpatialAcceleration:
    """Return the acceleration of the first or the second part."""
    t, v, a = rest.transform, rest.velocity, rest.acceleration
    if first:
        made = _first_acceleration(
            *(sub.rotation.wxyz, t.translation, whole.angular, whole.linear, sub_velocity.angular),
            *(v.angular, v.linear, a.angular, a.linear),
        )
    else:
        made = _second_acceleration(
            *(t.rotation.wxyz, sub.translation, whole.angular, whole.linear, v.angular),
            *(sub_velocity.angular, sub_velocity.linear, a.angular, a.linear),
        )
    return SpatialAcceleration(*made)


@lift(Quat, V3, V3, V3, V3, V3, out=(V3, V3))
def _first_velocity(q1: Quat, l2: V3, w: V3, v: V3, w2: V3, v2: V3) -> tuple[V3, V3]:
    """w1 = w - R1 w2; v1 = v - w1 x R1 l2 - R1 v2."""
    w1 = w - rotate(q1, w2)
    return w1, v - cross(w1, rotate(q1, l2)) - rotate(q1, v2)


@lift(Quat, V3, V3, V3, V3, V3, out=(V3, V3))
def _second_velocity(q1: Quat, l2: V3, w: V3, v: V3, w1: V3, v1: V3) -> tuple[V3, V3]:
    """w2 = R1' (w - w1); v2 = R1' (v - v1 - w1 x R1 l2)."""
    back = quat_conj(q1)
    return rotate(back, w - w1), rotate(back, v - v1 - cross(w1, rotate(q1, l2)))


@lift(Quat, V3, V3, V3, V3, V3, V3, V3, V3, out=(V3, V3))
def _first_acceleration(q1: Quat, l2: V3, alpha: V3, a: V3, w1: V3, w2: V3, v2: V3, alpha2: V3, a2: V3) -> tuple[V3, V3]:
    """alpha1 = alpha - R1 alpha2 - w1 x R1 w2; a1 = a - R1 a2 - alpha1 x r - w1 x (w1 x r) - 2 w1 x R1 v2, r = R1 l2."""
    r = rotate(q1, l2)
    alpha1 = alpha - rotate(q1, alpha2) - cross(w1, rotate(q1, w2))
    return alpha1, a - rotate(q1, a2) - cross(alpha1, r) - cross(w1, cross(w1, r) + rotate(q1, v2) * 2.0)


@lift(Quat, V3, V3, V3, V3, V3, V3, V3, V3, out=(V3, V3))
def _second_acceleration(q1: Quat, l2: V3, alpha: V3, a: V3, w1: V3, w2: V3, v2: V3, alpha1: V3, a1: V3) -> tuple[V3, V3]:
    """alpha2 = R1' (alpha - alpha1 - w1 x R1 w2); a2 = R1' (a - a1 - alpha1 x r - w1 x (w1 x r) - 2 w1 x R1 v2), r = R1 l2."""
    back, r = quat_conj(q1), rotate(q1, l2)
    alpha2 = rotate(back, alpha - alpha1 - cross(w1, rotate(q1, w2)))
    return alpha2, rotate(back, a - a1 - cross(alpha1, r) - cross(w1, cross(w1, r) + rotate(q1, v2) * 2.0))
