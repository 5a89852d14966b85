"""Names of frames and joints of an MJCF model: those that it has, and made-up ones, other than all that it has."""

from typing import Any


class Names:
    """Names of frames and joints, made up where the model has none: other than all that it has.

    Args:
        mujoco: The module.
        model: The compiled model.
    """

    def __init__(self, mujoco: Any, model: Any):
        counts = {"body": model.nbody, "joint": model.njnt, "site": model.nsite, "camera": model.ncam}
        counts |= {"equality": model.neq, "key": model.nkey}
        kinds = {kind: getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}") for kind in counts}
        self._given = {kind: [mujoco.mj_id2name(model, kinds[kind], i) for i in range(count)] for kind, count in counts.items()}
        self._frames = {name for kind in ("body", "site", "camera") for name in self._given[kind] if name}
        self._bodies = [name or unlike(f"body_{i}", self._frames) for i, name in enumerate(self._given["body"])]
        self._joints, self._equalities, self._keys = (self._made(kind) for kind in ("joint", "equality", "key"))
        self._used = set(self._bodies)

    def _made(self, kind: str) -> list[str]:
        taken = {name for name in self._given[kind] if name}
        return [name or unlike(f"{kind}_{i}", taken) for i, name in enumerate(self._given[kind])]

    def body(self, i: int) -> str:
        """Return the name of a body."""
        return self._bodies[i]

    def joint(self, i: int) -> str:
        """Return the name of a joint."""
        return self._joints[i]

    def equality(self, i: int) -> str:
        """Return the name of an equality constraint."""
        return self._equalities[i]

    def keyframe(self, i: int) -> str:
        """Return the name of a keyframe."""
        return self._keys[i]

    def between(self, body: int, joint: int) -> str:
        """Return a name for the frame between a body's parent and the body, below one of its joints."""
        return unlike(f"{self._bodies[body]}/{self._joints[joint]}", self._frames)

    def extra(self, kind: str, i: int) -> str:
        """Return the name of a site or camera; with its kind before it where another frame has that name."""
        name = self._given[kind][i] or unlike(f"{kind}_{i}", self._frames)
        if name in self._used:
            name = unlike(f"{kind}:{name}", self._frames)
        self._used.add(name)
        return name


def unlike(name: str, taken: set[str]) -> str:
    """Return a name, with underscores after it while it is taken; it is taken then."""
    while name in taken:
        name += "_"
    taken.add(name)
    return name
