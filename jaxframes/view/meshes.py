"""What a robot's URDF says that it looks like, as triangles: read with trimesh, from files below one folder, never from a network."""

import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

from jaxframes.errors import FrameError, MissingExtraError
from jaxframes.spatial import Rotation
from jaxframes.tree import FrameTree

KINDS = ("stl", "obj", "dae", "ply", "glb", "off")
LARGEST = 200_000_000
"""Bytes of one file."""


@dataclass(frozen=True)
class Shape:
    """Triangles that move with a frame.

    Attributes:
        frame: The frame's number.
        vertices: Corners [n, 3] in the frame, metres.
        faces: Corners of each triangle [m, 3].
    """

    frame: int
    vertices: np.ndarray
    faces: np.ndarray


def shapes_of(tree: FrameTree, root: str | PathLike[str]) -> list[Shape]:
    """Return what the ``visual`` elements of a tree's frames show.

    Args:
        tree: A tree that ``load_urdf`` made, or that includes such trees.
        root: Folder below which mesh files are: ``package://name/path`` is ``root/name/path``, or ``root/path`` where the folder is the
            package's own. Nothing outside of it is read.

    Raises:
        MissingExtraError: The extra ``view`` is not installed.
        FrameError: No frame has a ``visual``, a file is missing, lies outside the folder, is a URL, or is no mesh.
    """
    trimesh = _trimesh()
    folder = Path(fspath(root)).resolve()
    if not folder.is_dir():
        raise FrameError(f"meshes={fspath(root)!r}: there is no such folder; name the one that holds the package's meshes")
    found = [shape for frame, name in enumerate(tree.names) for shape in _shapes(trimesh, tree.properties[name], frame, name, folder)]
    if not found:
        raise FrameError("meshes= needs frames with a visual, as load_urdf keeps them; this tree has none")
    return found


def _trimesh() -> Any:
    try:
        import collada  # noqa: F401  (what trimesh reads .dae files with)
        import trimesh
    except ImportError as error:
        raise MissingExtraError("meshes need the packages 'trimesh' and 'pycollada': pip install 'jaxframes[view]'") from error
    return trimesh


def _shapes(trimesh: Any, properties: Mapping[str, Any], frame: int, name: str, folder: Path) -> Iterator[Shape]:
    visuals = properties.get("visual", ())
    for visual in (visuals,) if isinstance(visuals, Mapping) else visuals:
        geometry = visual.get("geometry", {})
        mesh = _geometry(trimesh, geometry, name, folder)
        origin = visual.get("origin", {})
        turned = Rotation.from_rpy(*_floats(origin.get("rpy", (0, 0, 0))))
        rotation = (Rotation.from_quaternion_xyzw(_floats(origin["quat_xyzw"])) if "quat_xyzw" in origin else turned).to_matrix()
        vertices = np.asarray(mesh.vertices, float) @ np.asarray(rotation, float).T + _floats(origin.get("xyz", (0, 0, 0)))
        yield Shape(frame, vertices.astype(np.float32), np.asarray(mesh.faces, np.uint32))


def _floats(values: Any) -> np.ndarray:
    if isinstance(values, str):
        values = values.split()
    return np.asarray(values, float).reshape(-1)


def _geometry(trimesh: Any, geometry: Mapping[str, Any], name: str, folder: Path) -> Any:
    """Return the mesh of a ``geometry`` element."""
    if "mesh" in geometry:
        facts = geometry["mesh"]
        mesh = _read(trimesh, _below(folder, str(facts.get("filename", "")), name), name)
        mesh.apply_scale(np.broadcast_to(_floats(facts.get("scale", 1.0)), 3))
        return mesh
    if "box" in geometry:
        return trimesh.creation.box(extents=_floats(geometry["box"]["size"]))
    if "cylinder" in geometry:
        facts = geometry["cylinder"]
        return trimesh.creation.cylinder(radius=float(facts["radius"]), height=float(facts["length"]), sections=24)
    if "sphere" in geometry:
        return trimesh.creation.icosphere(subdivisions=3, radius=float(geometry["sphere"]["radius"]))
    raise FrameError(f"frame {name!r}: a visual is a mesh, box, cylinder or sphere; found {', '.join(geometry) or 'nothing'}")


def _below(folder: Path, address: str, name: str) -> Path:
    """Return the file that an address means, which lies below the folder (FrameError for anything else)."""
    about = f"frame {name!r}: the mesh {address!r}"
    scheme, marked, rest = address.partition("://")
    if marked and scheme != "package":
        raise FrameError(f"{about} is an address of the kind {scheme}://; only files below meshes={str(folder)!r} are read")
    candidates: Sequence[str] = (rest, rest.partition("/")[2]) if marked else (address,)
    for candidate in candidates:
        path = (folder / candidate).resolve()
        if not path.is_relative_to(folder):
            raise FrameError(f"{about} lies outside the folder meshes={str(folder)!r}, and nothing outside of it is read")
        if candidate and path.is_file():
            return path
    raise FrameError(f"{about} is not below meshes={str(folder)!r}; name the folder that holds {candidates[-1]!r}")


def _read(trimesh: Any, path: Path, name: str) -> Any:
    """Return the mesh in a file, all its parts as one; files that it names in turn (textures) are not looked for."""
    kind = path.suffix[1:].lower()
    if kind not in KINDS or path.stat().st_size > LARGEST:
        raise FrameError(f"frame {name!r}: {path.name} is no mesh that is read: {', '.join(KINDS)}, up to {LARGEST // 10**6} MB")
    try:
        mesh = trimesh.load(io.BytesIO(path.read_bytes()), file_type=kind, force="mesh", skip_materials=True)
    except Exception as problem:  # whatever a damaged file makes a reader raise
        raise FrameError(f"frame {name!r}: {path.name} cannot be read: {type(problem).__name__}: {problem}") from problem
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise FrameError(f"frame {name!r}: {path.name} cannot be read: it holds no triangles")
    return mesh
