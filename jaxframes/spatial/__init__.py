"""The values users hold: rotations, poses, velocities, accelerations, motions, twists, wrenches, epochs. Knows no tree."""

from jaxframes.numerics.batch import concatenate as concatenate
from jaxframes.numerics.batch import stack as stack
from jaxframes.spatial import kdl as kdl
from jaxframes.spatial import serialization
from jaxframes.spatial.compare import allclose as allclose
from jaxframes.spatial.motion import Motion as Motion
from jaxframes.spatial.rotation import Rotation as Rotation
from jaxframes.spatial.transform import Transform as Transform
from jaxframes.spatial.twist import Twist as Twist
from jaxframes.spatial.twist import Wrench as Wrench
from jaxframes.spatial.velocity import SpatialAcceleration as SpatialAcceleration
from jaxframes.spatial.velocity import SpatialVelocity as SpatialVelocity
from jaxframes.time.epoch import Epoch as Epoch

serialization.register((Epoch, Motion, Rotation, SpatialAcceleration, SpatialVelocity, Transform, Twist, Wrench))
