"""Edge families: what can stand between a parent and its child."""

from jaxframes.tree.edges.attachable import Attachable as Attachable
from jaxframes.tree.edges.base import Edge as Edge
from jaxframes.tree.edges.base import Inputs as Inputs
from jaxframes.tree.edges.base import family as family
from jaxframes.tree.edges.joints import Prismatic as Prismatic
from jaxframes.tree.edges.joints import Revolute as Revolute
from jaxframes.tree.edges.rigid import Fixed as Fixed
from jaxframes.tree.edges.rigid import Prescribed as Prescribed
