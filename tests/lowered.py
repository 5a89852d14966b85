"""What the compiler is handed: checks on lowered programs that any part of the package can use."""

import re

import jax

COMPUTATION = re.compile(r"^%?(?:fused_computation|region|wrapped)[\w.\-]*[^\n]*\{$(.*?)^\}", re.MULTILINE | re.DOTALL)
STAGE = re.compile(r"call @([\w.]+)\(.*inlineable = .false.")
FUNCTION = re.compile(r"^  func\.func (?:public|private) @([\w.]+)\([^\n]*\{$(.*?)^  \}", re.MULTILINE | re.DOTALL)
DOT = re.compile(r"stablehlo\.(dot_general|dot|convolution)\b[^\n]*")


def products(function, *arguments, platforms=("cpu", "cuda")):
    """Return the text of every matrix product in the lowered program of a function."""
    text = jax.jit(function).trace(*arguments).lower(lowering_platforms=platforms).as_text()
    return [match.group(0) for match in DOT.finditer(text)]


def stages(function, *arguments, platforms=("cpu",)):
    """Return how many parts of the lowered program of a function are kept apart."""
    text = jax.jit(function).trace(*arguments).lower(lowering_platforms=platforms).as_text()
    return len(STAGE.findall(text))


def calls_within_stages(function, *arguments):
    """Return the names of stages of a function's lowered program that call something in turn: it would not be fused with the rest."""
    text = jax.jit(function).trace(*arguments).lower(lowering_platforms=("cpu",)).as_text()
    bodies = dict(FUNCTION.findall(text))
    return [name for name in set(STAGE.findall(text)) if "call @" in bodies[name]]


def assert_highest_precision(function, *arguments):
    """Assert that no matrix product of a function's program runs in a precision below HIGHEST, on any platform.

    On recent GPUs the default precision of a float32 product is 10 bits of mantissa.
    """
    for line in products(function, *arguments):
        assert re.search(r"precision = \[HIGHEST, HIGHEST\]", line), line


def compiled_shape(function, *arguments):
    """Return (instructions in the largest fused computation, floating-point operations) of a function's compiled program."""
    made = jax.jit(function).lower(*arguments).compile()
    sizes = [match.group(1).count("\n") for match in COMPUTATION.finditer(made.as_text())]
    cost = made.cost_analysis()
    cost = cost[0] if isinstance(cost, list) else cost
    return max(sizes, default=0), cost.get("flops", 0.0)
