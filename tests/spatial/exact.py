"""Rotations and poses in 60 digits: plain mpmath formulas, written from the definitions and sharing nothing with the library."""

import mpmath as mp
import numpy as np

mp.mp.dps = 60


def numbers(values):
    """Return nested floats as nested mpmath numbers, exactly."""
    return [numbers(v) for v in values] if np.ndim(values) else mp.mpf(float(values))


def norm(v):
    return mp.sqrt(sum(c * c for c in v))


def exp_quaternion(v):
    """Return the quaternion wxyz of a rotation vector."""
    angle = norm(v)
    scale = mp.sin(angle / 2) / angle if angle else mp.mpf(1) / 2
    return [mp.cos(angle / 2), *(c * scale for c in v)]


def log_quaternion(q):
    """Return the rotation vector of a quaternion with w taken as it is (no choice of sign)."""
    w, u = q[0], q[1:]
    size = norm(u)
    scale = 2 * mp.atan2(size, w) / size if size else 2 / w
    return [c * scale for c in u]


def product(p, q):
    """Return the Hamilton product."""
    a, b, c, d = p
    e, f, g, h = q
    return [
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    ]


def conjugate(q):
    return [q[0], -q[1], -q[2], -q[3]]


def matrix(q):
    """Return the nine entries of the matrix of a quaternion of any norm, row by row: columns are q e q* / |q|^2."""
    size = sum(c * c for c in q)
    columns = []
    for axis in range(3):
        unit = [mp.mpf(0)] * 4
        unit[axis + 1] = mp.mpf(1)
        columns.append([c / size for c in product(product(q, unit), conjugate(q))[1:]])
    return [columns[j][i] for i in range(3) for j in range(3)]


def rotate(q, v):
    return product(product(q, [mp.mpf(0), *v]), conjugate(q))[1:]


def derivative(function, x, order=1, step="1e-10"):
    """Return the first or second derivatives of a list-valued function of a list, by central differences in 60 digits.

    Shape [outputs, inputs] or [outputs, inputs, inputs]; truncation is of relative order 1e-20.
    """
    n, step = len(x), mp.mpf(step)

    def moved(*shifts):
        point = list(x)
        for index, amount in shifts:
            point[index] += amount * step
        return function(point)

    if order == 1:
        columns = [[(a - b) / (2 * step) for a, b in zip(moved((i, 1)), moved((i, -1)), strict=True)] for i in range(n)]
        return np.array([[float(columns[i][k]) for i in range(n)] for k in range(len(columns[0]))])
    outputs = len(function(list(x)))
    result = np.zeros((outputs, n, n))
    for i in range(n):
        for j in range(i, n):
            corners = [moved((i, a), (j, b)) for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
            for k in range(outputs):
                value = (corners[0][k] - corners[1][k] - corners[2][k] + corners[3][k]) / (4 * step * step)
                result[k, i, j] = result[k, j, i] = float(value)
    return result
