"""The values users hold: rotations, poses, velocities, accelerations, motions, twists, wrenches, epochs. Knows no tree."""

from jaxframes.numerics.batch import concatenate as concatenate
from jaxframes.numerics.batch import stack as stack
from jaxframes.spatial import serialization
from jaxframes.spatial.compare import allclose as allclose
from jaxframes.spatial.delta import add_delta as add_delta
from jaxframes.spatial.delta import diff as diff
from jaxframes.spatial.delta import integrate_body_first_order as integrate_body_first_order
from jaxframes.spatial.motion import Motion as Motion
from jaxframes.spatial.rotation import Rotation as Rotation
from jaxframes.spatial.transform import Transform as Transform
from jaxframes.spatial.twist import Twist as Twist
from jaxframes.spatial.twist import Wrench as Wrench
from jaxframes.spatial.vectors import cross as cross
from jaxframes.spatial.vectors import dot as dot
from jaxframes.spatial.vectors import equal as equal
from jaxframes.spatial.vectors import norm as norm
from jaxframes.spatial.vectors import normalize as normalize
from jaxframes.spatial.velocity import SpatialAcceleration as SpatialAcceleration
from jaxframes.spatial.velocity import SpatialVelocity as SpatialVelocity
from jaxframes.spatial.velocity import phi as phi
from jaxframes.time.epoch import Epoch as Epoch

serialization.register((Epoch, Motion, Rotation, SpatialAcceleration, SpatialVelocity, Transform, Twist, Wrench))
