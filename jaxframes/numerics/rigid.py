"""Rigid motions as components: pose, velocity and acceleration composed, inverted and compared.

A motion of p relative to o holds R (as a quaternion), l, w, v, alpha, a as an observer fixed in o sees them, in o's axes:
w is the angular velocity, v and a are the first and second derivatives of the coordinates l. ``order`` says how much is
computed: 0 the pose, 1 and the velocity, 2 and the acceleration; what is not computed stays a known zero.
"""

from dataclasses import dataclass

import jax

from jaxframes.numerics.components import IDENTITY, V3, ZERO, Quat, cross, quat_conj, quat_mul, rotate


@jax.tree_util.register_dataclass
@dataclass(frozen=True, slots=True)
class Rigid:
    """A rigid motion: rotation, translation, angular and linear velocity, angular and linear acceleration."""

    rotation: Quat = IDENTITY
    translation: V3 = ZERO
    angular: V3 = ZERO
    linear: V3 = ZERO
    angular2: V3 = ZERO
    linear2: V3 = ZERO


AT_REST = Rigid()


def compose(first: Rigid, second: Rigid, order: int) -> Rigid:
    """Return the motion o -> p from o -> m and m -> p.

    With r = R1 l2: w = w1 + R1 w2, v = v1 + w1 x r + R1 v2, alpha = alpha1 + R1 alpha2 + w1 x R1 w2,
    a = a1 + R1 a2 + alpha1 x r + w1 x (w1 x r) + 2 w1 x R1 v2 (the theorem of Coriolis).
    """
    q1 = first.rotation
    rotation, r = quat_mul(q1, second.rotation), rotate(q1, second.translation)
    translation = first.translation + r
    if order == 0:
        return Rigid(rotation, translation)
    w1, w2, v2 = first.angular, rotate(q1, second.angular), rotate(q1, second.linear)
    w_x_r = cross(w1, r)
    angular, linear = w1 + w2, first.linear + w_x_r + v2
    if order == 1:
        return Rigid(rotation, translation, angular, linear)
    angular2 = first.angular2 + rotate(q1, second.angular2) + cross(w1, w2)
    linear2 = first.linear2 + rotate(q1, second.linear2) + cross(first.angular2, r) + cross(w1, w_x_r + v2 * 2.0)
    return Rigid(rotation, translation, angular, linear, angular2, linear2)


def inverse(motion: Rigid, order: int) -> Rigid:
    """Return the motion of o relative to p: v' = -R'(v - w x l), a' = -R'(a - alpha x l - 2 w x v + w x (w x l))."""
    back, moved = quat_conj(motion.rotation), motion.translation
    rotation, translation = back, -rotate(back, moved)
    if order == 0:
        return Rigid(rotation, translation)
    w, v = motion.angular, motion.linear
    drift = v - cross(w, moved)
    angular, linear = -rotate(back, w), -rotate(back, drift)
    if order == 1:
        return Rigid(rotation, translation, angular, linear)
    a_seen = motion.linear2 - cross(motion.angular2, moved) - cross(w, v + drift)
    return Rigid(rotation, translation, angular, linear, -rotate(back, motion.angular2), -rotate(back, a_seen))


def relative(observer: Rigid, target: Rigid, order: int) -> Rigid:
    """Return the motion of ``target`` as ``observer`` sees it; both are given relative to one common frame c.

    With r = l_p - l_o and u = v_p - v_o - w_o x r, all turned into the observer's axes: w = w_p - w_o, v = u,
    alpha = alpha_p - alpha_o - w_o x w_p, a = a_p - a_o - alpha_o x r - w_o x (w_o x r) - 2 w_o x u.
    """
    back = quat_conj(observer.rotation)
    r = target.translation - observer.translation
    rotation, translation = quat_mul(back, target.rotation), rotate(back, r)
    if order == 0:
        return Rigid(rotation, translation)
    wo, wp = observer.angular, target.angular
    swept = cross(wo, r)
    u = target.linear - observer.linear - swept
    angular, linear = rotate(back, wp - wo), rotate(back, u)
    if order == 1:
        return Rigid(rotation, translation, angular, linear)
    angular2 = target.angular2 - observer.angular2 - cross(wo, wp)
    linear2 = target.linear2 - observer.linear2 - cross(observer.angular2, r) - cross(wo, swept + u * 2.0)
    return Rigid(rotation, translation, angular, linear, rotate(back, angular2), rotate(back, linear2))


def express(rotation: Quat, motion: Rigid) -> Rigid:
    """Return the motion with its velocity and acceleration turned by a rotation; pose untouched."""
    turned = (rotate(rotation, v) for v in (motion.angular, motion.linear, motion.angular2, motion.linear2))
    return Rigid(motion.rotation, motion.translation, *turned)
