"""The house rules: imports point one way, every module says what it is for, no file grows too long, imports stay light."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / "jaxframes"
FILES = sorted(p for p in PACKAGE.rglob("*.py"))
LAYERS = {
    **{
        "_version": 0,
        "errors": 0,
        "staging": 1,
        "numerics": 2,
        "time": 3,
        "spatial": 4,
        "edges": 5,
        "tables": 6,
        "model": 6,
        "kinematics": 7,
    },
    **{"tree": 8, "spice": 9, "io": 9, "view": 9, "bulk": 9, "data": 9, "__init__": 10, "cli": 11, "__main__": 12},
}
LONGEST = 350


def name_of(path):
    return str(path.relative_to(PACKAGE))


def layer_of(parts):
    return LAYERS[parts[0]] if parts else LAYERS["__init__"]


def imported(path):
    """Every file or folder of the package that a file imports, wherever in the file, as parts below ``jaxframes``.

    Of ``from folder import name`` the file of that name where there is one.
    """
    for node in ast.walk(ast.parse(path.read_text())):
        names = []
        if isinstance(node, ast.Import):
            names = [tuple(alias.name.split(".")) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name_of(path)}:{node.lineno}: relative import"
            base = tuple((node.module or "").split("."))
            names = [(*base, alias.name) if is_module((*base, alias.name)[1:]) else base for alias in node.names]
        for name in names:
            if name[0] == "jaxframes":
                yield node.lineno, name[1:]


def is_module(parts):
    place = PACKAGE.joinpath(*parts)
    return place.with_suffix(".py").exists() or place.is_dir()


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_imports_point_one_way(path):
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    own = layer_of(parts)
    for line, target in imported(path):
        if not target:
            assert parts[0] in ("__main__", "cli"), f"{name_of(path)}:{line} imports the whole package"
            continue
        room = target[0] if target[0] in LAYERS else "__init__"
        assert LAYERS[room] < own or room == parts[0], f"{name_of(path)}:{line} imports {'.'.join(target)}, which lies above"


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_every_module_says_what_it_is_for(path):
    assert ast.get_docstring(ast.parse(path.read_text())), f"{name_of(path)} has no docstring"


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_no_file_grows_too_long(path):
    assert len(path.read_text().splitlines()) <= LONGEST


UNSTABLE = ("jax.core", "jax.extend", "jax.interpreters", "jax.experimental", "jax._src")
"""Parts of JAX that may change with any release."""


def test_unstable_parts_of_jax_are_named_in_one_folder():
    offenders = []
    for path in FILES:
        if path.relative_to(PACKAGE).parts[0] == "staging":
            continue
        text = path.read_text()
        offenders += [f"{name_of(path)}: {name}" for name in (*UNSTABLE, "make_user_context", "make_jaxpr", ".jaxpr") if name in text]
    assert offenders == []


def test_one_file_imports_spiceypy():
    assert [name_of(p) for p in FILES if "spiceypy" in imports_of(p)] == [str(Path("spice", "reading", "worker.py"))]


def graph():
    """The files of the package by module name, and which of them each imports: anywhere in it, for type checking too."""
    by_parts = {path.relative_to(PACKAGE).with_suffix("").parts: path for path in FILES}
    by_parts = {parts[:-1] if parts[-1] == "__init__" else parts: path for parts, path in by_parts.items()}
    return {
        ".".join(("jaxframes", *parts)): {".".join(("jaxframes", *t)) for _, t in imported(path) if t in by_parts and t != parts}
        for parts, path in by_parts.items()
    }


def circles(imports):
    """Files that can be reached from themselves, with what each of them imports of the others."""
    reached = {module: set(targets) for module, targets in imports.items()}
    grown = True
    while grown:
        grown = False
        for own in reached.values():
            more = set().union(*(reached[target] for target in own)) - own
            own |= more
            grown = grown or bool(more)
    return {m: sorted(t for t in imports[m] if m in reached[t]) for m in imports if m in reached[m]}


def test_no_files_import_each_other_in_a_circle():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == {"b": ["c"], "c": ["b"]}
    assert circles(graph()) == {}


WINGS = {"reading": 0, "options": 1, "assembly": 1, "accuracy": 1, "extraction": 2, "fitting": 3}
"""Order of what is in spice/; everything else lies on top, and knows ``Kernels``."""


def test_the_wings_of_spice_import_one_way():
    for module, targets in graph().items():
        own = wing(module)
        above = [t for t in targets if own is not None and t.startswith("jaxframes.spice") and (wing(t) is None or wing(t) > own)]
        assert above == [], f"{module} imports {above}, which lie above"


def wing(module):
    """Place of a file of spice/ among its wings, None for what lies on top of them all, or elsewhere."""
    parts = module.split(".")
    return WINGS.get(parts[2]) if parts[1:2] == ["spice"] and len(parts) > 2 else None


def names_made_in(tree):
    """Every name that a module defines or assigns, attributes of ``self`` and ``cls`` among them."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            yield node.name
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and is_own(node.value):
            yield node.attr


def is_own(node):
    """Whether an expression is ``self``, ``cls`` or ``super()``."""
    called = node.func if isinstance(node, ast.Call) else None
    return (isinstance(node, ast.Name) and node.id in ("self", "cls")) or (isinstance(called, ast.Name) and called.id == "super")


def is_private(name):
    return name.startswith("_") and not name.startswith("__") and name not in ("_replace", "_fields", "_asdict", "_make")  # named tuples'


def private_names(text):
    """Private names of other modules that a module reads: attributes of anything but its own classes, and imports."""
    tree = ast.parse(text)
    own = set(names_made_in(tree))
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and is_private(node.attr) and node.attr not in own and not is_own(node.value):
            yield f"{node.lineno}: {ast.unparse(node)}"
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "jaxframes":
            yield from (f"{node.lineno}: {alias.name}" for alias in node.names if is_private(alias.name) and alias.name != "_version")


def test_private_names_are_read_in_their_own_module_alone():
    assert sorted(private_names("import a\nclass C:\n    def f(self, other): return self._x + other._x + other._f() + a._g")) == [
        "3: a._g",
        "3: other._f",
        "3: other._x",
    ]
    assert list(private_names("class C:\n    _x = 1\n    def f(self, other): return super()._y + other._x")) == []
    assert [f"{name_of(path)}:{found}" for path in FILES for found in private_names(path.read_text())] == []


FOREIGN = {"staging": "JAX", "io/interop.py": "SciPy", "spice/reading/worker.py": "exceptions of spiceypy"}
"""Where an object of another library may be asked what it has."""
ARRAY_LIKE = ("dtype", "shape")
"""What any array-like of a user may have or not, and what is read of the answer."""


def duck_typing(text):
    """Calls that ask an object whether it has an attribute that a base class would say it has."""
    for node in ast.walk(ast.parse(text)):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("hasattr", "getattr")):
            continue
        name = node.args[1]
        known = isinstance(name, ast.Constant)
        asks = node.func.id == "hasattr" or len(node.args) == 3 or known
        if asks and not (known and name.value in ARRAY_LIKE) and not (known and isinstance(node.args[0], ast.Call)):
            yield f"{node.lineno}: {ast.unparse(node)}"


def test_base_classes_say_what_there_is():
    assert list(duck_typing("hasattr(edge, 'info'); getattr(edge, 'info', None); getattr(edge, name); hasattr(x, 'dtype')")) == [
        "1: hasattr(edge, 'info')",
        "1: getattr(edge, 'info', None)",
    ]
    files = [path for path in FILES if not name_of(path).replace("\\", "/").startswith(tuple(FOREIGN))]
    assert [f"{name_of(path)}:{found}" for path in files for found in duck_typing(path.read_text())] == []


def imports_of(path):
    nodes = list(ast.walk(ast.parse(path.read_text())))
    plain = {a.name.split(".")[0] for n in nodes if isinstance(n, ast.Import) for a in n.names}
    return plain | {n.module.split(".")[0] for n in nodes if isinstance(n, ast.ImportFrom) and n.module}


IMPORT_PROBE = """
import jax, time, sys
before = {name: getattr(jax.config, name) for name in ("jax_enable_x64", "jax_default_matmul_precision", "jax_numpy_rank_promotion")}
opened = []
def watch(event, arguments):
    if event in ("open", "socket.connect", "subprocess.Popen") and not str(arguments[0]).endswith((".py", ".pyc", ".so")):
        opened.append((event, arguments[0]))
sys.addaudithook(watch)
start = time.perf_counter()
import jaxframes
cost = time.perf_counter() - start
seen = list(opened)
assert before == {name: getattr(jax.config, name) for name in before}, "global configuration changed"
assert not [s for s in seen if "__pycache__" not in str(s[1])], seen
from jax._src import xla_bridge
assert not xla_bridge._backends, "a backend was started"
heavy = [m for m in ("spiceypy", "matplotlib", "jaxlie", "mujoco", "xarray", "viser", "websockets", "trimesh") if m in sys.modules]
assert not heavy, heavy  # scipy is not listed: jax itself imports it
print(cost)
"""


def test_import_is_light_and_changes_nothing():
    costs = []
    for _ in range(5):
        done = subprocess.run([sys.executable, "-c", IMPORT_PROBE], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        costs.append(float(done.stdout))
    print(f"importing jaxframes costs {min(costs):.3f} s beyond jax")  # asked: 0.15 s; tests never assert on a clock


def test_the_facade_shows_the_public_names_only():
    import jaxframes

    shown = dir(jaxframes)
    assert shown == sorted(jaxframes.__all__)
    rooms = {p.name for p in PACKAGE.iterdir() if p.is_dir()} | {p.stem for p in PACKAGE.glob("*.py")}
    assert {name for name in shown if name in rooms} == {"edges", "errors", "spice", "tables"}
    for name in shown:
        assert getattr(jaxframes, name) is not None
