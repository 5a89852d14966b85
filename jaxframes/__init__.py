"""Reference frames for JAX: trees of robots, spacecraft and ephemerides as compiled, differentiable functions."""

from jaxframes import kinematics as kinematics
from jaxframes import spice as spice
from jaxframes._version import __version__ as __version__
from jaxframes.errors import FrameError as FrameError
from jaxframes.io.json_tree import from_json as from_json
from jaxframes.io.json_tree import to_json as to_json
from jaxframes.spatial import Epoch as Epoch
from jaxframes.spatial import Motion as Motion
from jaxframes.spatial import Rotation as Rotation
from jaxframes.spatial import SpatialAcceleration as SpatialAcceleration
from jaxframes.spatial import SpatialVelocity as SpatialVelocity
from jaxframes.spatial import Transform as Transform
from jaxframes.spatial import Twist as Twist
from jaxframes.spatial import Wrench as Wrench
from jaxframes.tree import FrameTree as FrameTree
from jaxframes.tree import State as State
from jaxframes.tree.state import Attachments as Attachments
from jaxframes.tree import TreeBuilder as TreeBuilder
from jaxframes.tree import edges as edges
from jaxframes.tree.chain import Chain as Chain
from jaxframes.tree.text import DumpOptions as DumpOptions
from jaxframes.view.export import to_dot as to_dot
from jaxframes.view.export import to_mermaid as to_mermaid
