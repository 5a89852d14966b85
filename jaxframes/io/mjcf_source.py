"""MJCF read safely: from a path, text or MuJoCo's own objects to a compiled model, with MuJoCo's warnings as Python's.

MuJoCo by itself writes what it warns of into a file in the current folder, and reads any file that text includes.
"""

import contextlib
import importlib
import warnings
from collections.abc import Iterator
from typing import Any

from jaxframes.errors import FormatError, FrameWarning, MissingExtraError
from jaxframes.io.xml_nodes import TEXT, element_names, read


def mujoco() -> Any:
    """Return the package (MissingExtraError where it is not installed)."""
    try:
        return importlib.import_module("mujoco")
    except ImportError as error:
        raise MissingExtraError("reading MJCF needs the package 'mujoco': pip install 'jaxframes[mujoco]'") from error


def compiled(source: Any) -> Any:
    """Return the compiled model of a path, text, ``mujoco.MjSpec`` or ``mujoco.MjModel``.

    Raises:
        MissingExtraError: MuJoCo is not installed.
        FormatError: It cannot be read, is a URDF, is text that includes files, or MuJoCo refuses it or finds numbers that are none.
    """
    package = mujoco()
    if isinstance(source, package.MjModel):
        return source
    if isinstance(source, package.MjSpec):
        label, make = "the mujoco.MjSpec given", source.compile
    else:
        data, label = read(source, kinds="a path, text, a mujoco.MjSpec or a mujoco.MjModel")
        make = _maker(package, source, data, label)
    with _heard(package) as said:
        try:
            model = make()
        except ValueError as error:
            raise FormatError(f"{label}: MuJoCo refuses the model: {error}") from None
    for sentence in dict.fromkeys(said):
        if "NaN" in sentence:
            raise FormatError(f"{label}: a number in it is none: {sentence}")
        warnings.warn(f"{label}: {sentence}", FrameWarning, stacklevel=3)
    return model


def _maker(package: Any, source: Any, data: bytes, label: str) -> Any:
    elements = element_names(data)
    if elements[:1] == ["robot"]:
        raise FormatError(
            f"{label} is a URDF (<robot>); read it with jf.load_urdf. MuJoCo would fuse links that are fixed together and drop mimic joints"
        )
    if label != TEXT:
        return lambda: package.MjModel.from_xml_path(str(source))
    if "include" in elements:
        raise FormatError(f"{label} includes files, which text may not: it could read any file here; write it to a file and give the path")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FormatError(f"{label} is not UTF-8: {error.reason} at byte {error.start}") from None
    return lambda: package.MjModel.from_xml_string(text)


@contextlib.contextmanager
def _heard(package: Any) -> Iterator[list[str]]:
    """Collect what MuJoCo warns of, instead of its log file."""
    said: list[str] = []
    before = package.get_mju_user_warning()
    package.set_mju_user_warning(said.append)
    try:
        yield said
    finally:
        package.set_mju_user_warning(before)
