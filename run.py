#!/usr/bin/env python3
"""Set up and run jaxframes from a checkout: needs only Python 3.11 or newer with venv, and a network the first time.

Makes ``.venv`` beside this file, installs the locked requirements and the package into it, then runs the verb.
A second run starts at once: the environment is rebuilt only when the lock file, pyproject.toml or the Python changes.
"""

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent
LOCK = ROOT / "requirements.lock"
MINIMUM = (3, 11)
VERBS = {
    "demo": "run the demonstration on the data that ships with the package (arguments go to `jaxframes demo`)",
    "test": "run the whole test suite, in float64 and then in float32 (arguments go to pytest)",
    "newest": "run the whole test suite on the newest jax there is, in an environment of its own, .venv-newest (arguments go to pytest)",
    "check": "run the formatter check, the linter and the type checker",
    "bench": "run a benchmark by its name in benchmarks/, e.g. `bench spice_tables`",
    "setup": "only make the environment",
    "python": "run the environment's Python with the arguments given",
}


def environment_dir(verb: str) -> Path:
    """Return the folder of the virtual environment (``JAXFRAMES_VENV`` names another one)."""
    return Path(os.environ.get("JAXFRAMES_VENV", ROOT / (".venv-newest" if verb == "newest" else ".venv"))).resolve()


def interpreter(venv: Path) -> Path:
    """Return the environment's Python."""
    return venv / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def fingerprint() -> str:
    """Return what the environment is made from; a change of it rebuilds the environment."""
    parts = [sys.version.encode(), str(ROOT).encode(), LOCK.read_bytes(), (ROOT / "pyproject.toml").read_bytes()]
    return hashlib.sha256(b"\0".join(parts)).hexdigest()


def fail(message: str) -> None:
    """Stop with a message on stderr."""
    sys.exit(f"run.py: {message}")


def require_venv() -> None:
    """Stop with the exact remedy where this Python cannot make virtual environments."""
    try:
        import ensurepip  # noqa: F401  (Debian splits it off into python3-venv)
        import venv  # noqa: F401
    except ImportError:
        version = f"{sys.version_info.major}.{sys.version_info.minor}"
        fail(
            f"this Python ({sys.executable}) has no venv module. On Debian or Ubuntu: apt-get install python{version}-venv; "
            f"on Fedora: dnf install python3; elsewhere install Python {version} from python.org. Then run this again."
        )


def set_up(verb: str) -> Path:
    """Make or refresh the environment and return its Python."""
    venv, stamp = environment_dir(verb), fingerprint()
    python, mark = interpreter(venv), venv / ".jaxframes-stamp"
    if not (python.exists() and mark.exists() and mark.read_text() == stamp):
        make(venv, python)
        mark.write_text(stamp)
    if verb == "newest":  # beyond the lock file, and beyond the versions that pyproject.toml allows
        newest = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--upgrade", "jax", "jaxlib"]
        if subprocess.run(newest).returncode:
            fail(f"this step failed: {' '.join(newest)}")
        subprocess.run([str(python), "-c", "import jax, jaxlib; print(f'jax {jax.__version__}, jaxlib {jaxlib.__version__}', flush=True)"])
    return python


def make(venv: Path, python: Path) -> None:
    """Make the environment anew from the lock file."""
    require_venv()
    print(f"run.py: making {venv} (first run, or the requirements changed); this downloads about 600 MB once", file=sys.stderr)
    shutil.rmtree(venv, ignore_errors=True)
    pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]
    for command in (
        [sys.executable, "-m", "venv", str(venv)],
        [*pip, "--require-hashes", "-r", str(LOCK)],
        [*pip, "--no-build-isolation", "--editable", str(ROOT)],
    ):
        if subprocess.run(command).returncode:
            fail(f"this step failed: {' '.join(command)}\nThe messages above say why; a network is needed. Then run this again.")


def commands(verb: str, python: Path, arguments: list[str]) -> list[list[str]]:
    """Return the commands a verb stands for."""
    py = str(python)
    if verb == "demo":
        return [[py, "-m", "jaxframes", "demo", *arguments]]
    if verb in ("test", "newest"):
        return [[py, "-m", "pytest", "-n", "auto", "--precision", precision, *arguments] for precision in ("float64", "float32")]
    if verb == "check":
        return [
            [py, "-m", "ruff", "format", "--check", "."],
            [py, "-m", "ruff", "check", "."],
            [py, "-m", "pyright", "--pythonpath", py],
        ]
    if verb == "bench":
        names = sorted(path.stem for path in (ROOT / "benchmarks").glob("*.py") if not path.stem.startswith("_"))
        if not arguments or arguments[0] not in names:
            fail(f"bench needs one of: {', '.join(names)}")
        return [[py, str(ROOT / "benchmarks" / f"{arguments[0]}.py"), *arguments[1:]]]
    return [[py, *arguments]] if verb == "python" else []


def main() -> int:
    """Run a verb and return its exit code (the first that is not zero)."""
    if sys.version_info < MINIMUM:
        fail(f"Python {MINIMUM[0]}.{MINIMUM[1]} or newer is needed; this is {sys.version.split()[0]} at {sys.executable}")
    parser = argparse.ArgumentParser(
        prog="run.py",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="verbs:\n" + "\n".join(f"  {verb:8s} {what}" for verb, what in VERBS.items()),
    )
    parser.add_argument("verb", choices=VERBS, metavar="verb", help="what to do (listed below)")
    parser.add_argument("arguments", nargs=argparse.REMAINDER, help="passed on to what the verb runs")
    options = parser.parse_args()
    for command in commands(options.verb, set_up(options.verb), options.arguments):
        code = subprocess.run(command, cwd=ROOT if options.verb in ("test", "newest", "check") else None).returncode
        if code:
            return code
    return 0


if __name__ == "__main__":
    sys.exit(main())
