"""Reference frames for JAX: trees of robots, spacecraft and ephemerides as compiled, differentiable functions."""

from jaxframes import edges, errors, spice, tables
from jaxframes._version import __version__
from jaxframes.errors import FrameError
from jaxframes.io import interop
from jaxframes.io.json_tree import from_json, to_json
from jaxframes.io.mjcf import load_mjcf
from jaxframes.io.mjcf_keyframes import mjcf_keyframes
from jaxframes.io.oem import Oem, OemSegment, load_oem
from jaxframes.io.robots import example_robot, example_robots
from jaxframes.io.urdf import load_urdf
from jaxframes.io.urdf_write import to_urdf
from jaxframes.kinematics.apparent import ApparentState
from jaxframes.model.state import Attachments, State
from jaxframes.numerics.batch import concatenate, stack
from jaxframes.spatial import (
    Motion,
    Rotation,
    SpatialAcceleration,
    SpatialVelocity,
    Transform,
    Twist,
    Wrench,
    allclose,
    kdl,
)
from jaxframes.time.epoch import Epoch
from jaxframes.time.scales import SHIPPED_LEAP_SECONDS, LeapSeconds
from jaxframes.tree.builder import TreeBuilder
from jaxframes.tree.chain import Chain
from jaxframes.tree.fit import JointFit
from jaxframes.tree.frame_tree import FrameTree
from jaxframes.tree.text import DumpOptions
from jaxframes.view.export import to_dot, to_mermaid
from jaxframes.view.live import Button, FramesGraph, show_frames_graph
from jaxframes.view.live_3d import Frames3D, show_frames_3d
from jaxframes.view.looks import numbered_labels
from jaxframes.view.picture import save_png
from jaxframes.view.static import to_html

__all__ = [
    "SHIPPED_LEAP_SECONDS",
    "ApparentState",
    "Attachments",
    "Button",
    "Chain",
    "DumpOptions",
    "Epoch",
    "FrameError",
    "FrameTree",
    "Frames3D",
    "FramesGraph",
    "JointFit",
    "LeapSeconds",
    "Motion",
    "Oem",
    "OemSegment",
    "Rotation",
    "SpatialAcceleration",
    "SpatialVelocity",
    "State",
    "Transform",
    "TreeBuilder",
    "Twist",
    "Wrench",
    "__version__",
    "allclose",
    "concatenate",
    "edges",
    "errors",
    "example_robot",
    "example_robots",
    "from_json",
    "interop",
    "kdl",
    "load_mjcf",
    "load_oem",
    "load_urdf",
    "mjcf_keyframes",
    "numbered_labels",
    "save_png",
    "show_frames_3d",
    "show_frames_graph",
    "spice",
    "stack",
    "tables",
    "to_dot",
    "to_html",
    "to_json",
    "to_mermaid",
    "to_urdf",
]


def __dir__() -> list[str]:
    """The public names: packages inside are reached by their full path only."""
    return __all__
