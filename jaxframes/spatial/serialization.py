"""Values in exported programs: how ``jax.export`` writes the types that may stand in a signature, and reads them again."""

from collections.abc import Iterable
from dataclasses import fields
from typing import Any

from jax import export


def register(kinds: Iterable[type]) -> None:
    """Tell ``jax.export`` how to write value types: by name. What is static in them is the name itself, so nothing else is stored."""
    for kind in kinds:
        _register(kind)


def _register(kind: type) -> None:
    static = tuple(f.default for f in fields(kind) if f.metadata.get("static"))  # pyright: ignore[reportArgumentType]

    def written(facts: Any) -> bytes:
        assert tuple(facts) == static, f"{kind.__name__} has static fields that no name stands for: {facts}"
        return b""

    export.register_pytree_node_serialization(
        kind, serialized_name=f"jaxframes.{kind.__name__}", serialize_auxdata=written, deserialize_auxdata=lambda data: static
    )
