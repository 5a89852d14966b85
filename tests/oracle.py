"""An independent oracle for trees: 4x4 matrices in mpmath, multiplied from the root, differentiated in time by central differences."""

import dataclasses

import mpmath as mp
import numpy as np

mp.mp.dps = 50
STEP = mp.mpf(10) ** -14


def rotation_matrix(vector):
    """Matrix of a rotation vector (Rodrigues)."""
    x, y, z = (mp.mpf(float(v)) if not isinstance(v, mp.mpf) else v for v in vector)
    angle = mp.sqrt(x * x + y * y + z * z)
    if angle == 0:
        return mp.eye(3)
    k = mp.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]]) / angle
    return mp.eye(3) + mp.sin(angle) * k + (1 - mp.cos(angle)) * k * k


def quaternion_matrix(wxyz):
    """Matrix of a quaternion, normalised."""
    w, x, y, z = (mp.mpf(float(v)) for v in wxyz)
    n = w * w + x * x + y * y + z * z
    return (
        mp.matrix(
            [
                [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
            ]
        )
        / n
    )


def pose(rotation, translation):
    out = mp.eye(4)
    for i in range(3):
        out[i, 3] = translation[i] if isinstance(translation[i], mp.mpf) else mp.mpf(float(translation[i]))
        for j in range(3):
            out[i, j] = rotation[i, j]
    return out


@dataclasses.dataclass
class Link:
    """One edge as a curve of poses: ``curve(t)`` is a 4x4 matrix near t = 0."""

    parent: int
    curve: object


def fixed(wxyz, translation):
    matrix = pose(quaternion_matrix(wxyz), translation)
    return lambda t: matrix


def joint(kind, axis, placement, q, qd, qdd):
    """Placement, then a rotation about or a translation along the axis by q + qd t + qdd t2 / 2."""
    base, axis = placement(0), [mp.mpf(float(a)) for a in axis]

    def curve(t):
        s = mp.mpf(float(q)) + mp.mpf(float(qd)) * t + mp.mpf(float(qdd)) * t * t / 2
        moved = [a * s for a in axis]
        return base * (pose(rotation_matrix(moved), [0, 0, 0]) if kind == "revolute" else pose(mp.eye(3), moved))

    return curve


def prescribed(wxyz, translation, w, v, alpha, a):
    base = quaternion_matrix(wxyz)
    second = lambda x, t, first, half: mp.mpf(float(x)) + mp.mpf(float(first)) * t + mp.mpf(float(half)) * t * t / 2

    def curve(t):
        turn = [second(0, t, w[i], alpha[i]) for i in range(3)]
        return pose(rotation_matrix(turn) * base, [second(translation[i], t, v[i], a[i]) for i in range(3)])

    return curve


def world(links, frame, t):
    out = mp.eye(4)
    while frame > 0:
        out = links[frame].curve(t) * out
        frame = links[frame].parent
    return out


def inverse(matrix):
    out, turned = mp.eye(4), matrix[0:3, 0:3].T
    moved = -(turned * matrix[0:3, 3])
    for i in range(3):
        out[i, 3] = moved[i]
        for j in range(3):
            out[i, j] = turned[i, j]
    return out


def relative(links, of, relative_to, t=0):
    return inverse(world(links, relative_to, t)) * world(links, of, t)


def motion(links, of, relative_to):
    """R, l, w, v, alpha, a of ``of`` relative to ``relative_to`` as float64 arrays, by central differences at 50 digits."""
    h = STEP
    before, now, after = (relative(links, of, relative_to, t) for t in (-h, mp.mpf(0), h))
    first, second = (after - before) / (2 * h), (after - 2 * now + before) / (h * h)
    spin = first[0:3, 0:3] * now[0:3, 0:3].T
    bend = second[0:3, 0:3] * now[0:3, 0:3].T - spin * spin
    vee = lambda m: [m[2, 1], m[0, 2], m[1, 0]]
    array = lambda m: np.array([float(x) for x in m])
    rotation = np.array([[float(now[i, j]) for j in range(3)] for i in range(3)])
    return rotation, array(now[0:3, 3]), array(vee(spin)), array(first[0:3, 3]), array(vee(bend)), array(second[0:3, 3])
