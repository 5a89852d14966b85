"""Poses of all frames relative to one, composed on the host in float64 from the motions of edges: paths start at the observer."""

from collections.abc import Sequence

import numpy as np

from jaxframes.numerics import host_quaternions

Poses = tuple[np.ndarray, np.ndarray]
"""Quaternions wxyz [n, 4] and positions [n, 3]."""


def poses_from(parents: Sequence[int], numbers: np.ndarray, observer: int) -> Poses:
    """Return the pose of every frame in one of them; near frames keep their digits however far the root is.

    Args:
        parents: Parent of each frame, -1 for the root.
        numbers: Motion of each frame relative to its parent, as ``local_motions`` gives it [n, 19].
        observer: The frame that everything is relative to.
    """
    beside: list[list[int]] = [[] for _ in parents]
    for frame, parent in enumerate(parents):
        if parent >= 0:
            beside[frame].append(parent)
            beside[parent].append(frame)
    wxyz, places = numbers[:, :4], numbers[:, 4:7]
    rotations, positions = np.zeros((len(parents), 4)), np.zeros((len(parents), 3))
    rotations[observer, 0] = 1.0
    level = [(observer, -1)]
    while level := [(other, frame) for frame, before in level for other in beside[frame] if other != before]:
        at, of = (np.array(column) for column in zip(*level, strict=True))
        down = np.array([parents[other] == frame for other, frame in level], bool)
        edge = np.where(down, at, of)  # the frame below the edge that is walked
        turn, shift = wxyz[edge], places[edge]
        back = turn * np.array([1.0, -1.0, -1.0, -1.0])
        turn, shift = np.where(down[:, None], turn, back), np.where(down[:, None], shift, -host_quaternions.rotate(back, shift))
        positions[at] = positions[of] + host_quaternions.rotate(rotations[of], shift)
        rotations[at] = host_quaternions.multiply(rotations[of], turn)
    return rotations, positions
