"""Steps: what an edge returns, and what they are made of; for families of your own.

An edge's motion is that of its child relative to its parent. It is said as a few steps one after the other, each in the axes that the
ones before it lead to:

- ``RotationStep(axis, angle)`` and ``TranslationStep(axis, length)`` about and along a unit axis, after a placement (``rotation``,
  ``translation``) if one is given; ``angle`` (rad) and ``length`` (m) are ``Coordinate(value, rate, rate2)``.
- ``Rigid(rotation, translation, angular, linear, angular2, linear2)``: a motion given outright. Velocities and accelerations are the
  derivatives of the child's coordinates, in the parent's axes.

``V3`` and ``Quat`` (w, x, y, z) hold components: arrays over the batch, or plain numbers known while tracing, with ``+``, ``-`` and ``*``.
``sin_cos`` of a component is as fast as it gets on CPUs.
"""

from jaxframes.numerics.components import V3 as V3
from jaxframes.numerics.components import Component as Component
from jaxframes.numerics.components import Quat as Quat
from jaxframes.numerics.rigid import Rigid as Rigid
from jaxframes.numerics.steps import Coordinate as Coordinate
from jaxframes.numerics.steps import RotationStep as RotationStep
from jaxframes.numerics.steps import Step as Step
from jaxframes.numerics.steps import TranslationStep as TranslationStep
from jaxframes.numerics.trig import sin_cos as sin_cos
