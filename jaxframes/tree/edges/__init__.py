"""Edge families: what can stand between a parent and its child."""

from jaxframes.tree.edges.attachable import Attachable as Attachable
from jaxframes.tree.edges.ball import Ball as Ball
from jaxframes.tree.edges.ball import Free as Free
from jaxframes.tree.edges.base import Edge as Edge
from jaxframes.tree.edges.base import Inputs as Inputs
from jaxframes.tree.edges.base import family as family
from jaxframes.tree.edges.compound import Planar as Planar
from jaxframes.tree.edges.compound import PrismaticSpherical as PrismaticSpherical
from jaxframes.tree.edges.compound import PrismaticUniversal as PrismaticUniversal
from jaxframes.tree.edges.compound import Spherical as Spherical
from jaxframes.tree.edges.compound import Universal as Universal
from jaxframes.tree.edges.joints import Continuous as Continuous
from jaxframes.tree.edges.joints import Cylindrical as Cylindrical
from jaxframes.tree.edges.joints import Prismatic as Prismatic
from jaxframes.tree.edges.joints import Revolute as Revolute
from jaxframes.tree.edges.joints import Screw as Screw
from jaxframes.tree.edges.mimic import Dependent as Dependent
from jaxframes.tree.edges.mimic import Mimic as Mimic
from jaxframes.tree.edges.rigid import Fixed as Fixed
from jaxframes.tree.edges.rigid import Prescribed as Prescribed
from jaxframes.tree.edges.stored import Movable as Movable
from jaxframes.tree.edges.stored import Virtual as Virtual
