"""Edge families: what can stand between a parent and its child, and what a family of your own is made of (``docs/extending.md``)."""

from jaxframes.edges import steps as steps
from jaxframes.edges.attachable import Attachable as Attachable
from jaxframes.edges.axis_joints import Continuous as Continuous
from jaxframes.edges.axis_joints import Cylindrical as Cylindrical
from jaxframes.edges.axis_joints import Prismatic as Prismatic
from jaxframes.edges.axis_joints import Revolute as Revolute
from jaxframes.edges.axis_joints import Screw as Screw
from jaxframes.edges.base import Edge as Edge
from jaxframes.edges.base import Inputs as Inputs
from jaxframes.edges.compound_joints import Planar as Planar
from jaxframes.edges.compound_joints import PrismaticSpherical as PrismaticSpherical
from jaxframes.edges.compound_joints import PrismaticUniversal as PrismaticUniversal
from jaxframes.edges.compound_joints import Spherical as Spherical
from jaxframes.edges.compound_joints import Universal as Universal
from jaxframes.edges.family import family as family
from jaxframes.edges.fixed import Fixed as Fixed
from jaxframes.edges.function import Function as Function
from jaxframes.edges.joint import Virtual as Virtual
from jaxframes.edges.mimic import Dependent as Dependent
from jaxframes.edges.mimic import Mimic as Mimic
from jaxframes.edges.prescribed import Movable as Movable
from jaxframes.edges.prescribed import Prescribed as Prescribed
from jaxframes.edges.quaternion_joints import Ball as Ball
from jaxframes.edges.quaternion_joints import Free as Free
