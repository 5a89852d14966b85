"""How many programs a call compiles, as JAX itself reports."""

import jax

_COUNT = []
jax.monitoring.register_event_duration_secs_listener(lambda name, _, **more: _COUNT.append(name.endswith("backend_compile_duration")))


def compilations(function, *arguments):
    """How many programs a call compiles."""
    before = sum(_COUNT)
    jax.block_until_ready(function(*arguments))
    return sum(_COUNT) - before
