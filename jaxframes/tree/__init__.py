"""The frame tree: topology, edges, builder, state and the tree itself."""

from jaxframes.tree.builder import TreeBuilder as TreeBuilder
from jaxframes.tree.state import State as State
from jaxframes.tree.tree import FrameTree as FrameTree
