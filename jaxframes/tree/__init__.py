"""The frame tree: topology, edges, builder, state and the tree itself."""

from jaxframes.model.state import State as State
from jaxframes.tree.builder import TreeBuilder as TreeBuilder
from jaxframes.tree.frame_tree import FrameTree as FrameTree
