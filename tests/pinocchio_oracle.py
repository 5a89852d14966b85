"""Pinocchio as an oracle for robots: motions of all links and Jacobians, from joint values by name. Needs the package ``pin``."""

import numpy as np
import pinocchio as pin

AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class Robot:
    """A URDF as Pinocchio reads it; joints that mimic others follow them unless told otherwise.

    The base is fixed, or free with ``root="free"``: then ``base`` holds the first entries of q, v and a.
    """

    def __init__(self, path, mimic=True, root="fixed"):
        base = (pin.JointModelFreeFlyer(),) if root == "free" else ()
        self.model = pin.buildModelFromUrdf(str(path), *base, mimic=mimic)
        self.data = self.model.createData()
        self.base = ()

    def poses(self, links, q):
        """Return the matrices [n, 4, 4] of the links in the base."""
        pin.framesForwardKinematics(self.model, self.data, q)
        return np.array([self.data.oMf[self.model.getFrameId(link, pin.FrameType.BODY)].homogeneous for link in links])

    def values(self, q, qd, qdd):
        """Return Pinocchio's vectors from mappings of joint names to numbers."""
        vectors = pin.neutral(self.model), np.zeros(self.model.nv), np.zeros(self.model.nv)
        for vector, first in zip(vectors, self.base, strict=False):
            vector[: len(first)] = first
        for name in q:
            j = self.model.getJointId(name)
            joint = self.model.joints[j]
            assert joint.nv == 1, (name, joint.shortname())
            at = slice(joint.idx_q, joint.idx_q + joint.nq)
            vectors[0][at] = q[name] if joint.nq == 1 else [np.cos(q[name]), np.sin(q[name])]
            vectors[1][joint.idx_v], vectors[2][joint.idx_v] = qd[name], qdd[name]
        return vectors

    def motions(self, links, q, qd, qdd):
        """Return R [n, 3, 3], l, w, v, alpha, a [n, 3] of the links in the base: a is the classical acceleration."""
        pin.forwardKinematics(self.model, self.data, *self.values(q, qd, qdd))
        pin.updateFramePlacements(self.model, self.data)
        rows = []
        for link in links:
            f = self.model.getFrameId(link, pin.FrameType.BODY)
            pose = self.data.oMf[f]
            v = pin.getFrameVelocity(self.model, self.data, f, AXES)
            a = pin.getFrameClassicalAcceleration(self.model, self.data, f, AXES)
            rows.append((pose.rotation, pose.translation, v.angular, v.linear, a.angular, a.linear))
        return tuple(np.array(part) for part in zip(*rows, strict=True))

    def jacobian(self, link, joints, q, qd, qdd):
        """Return the Jacobian [6, n] of a link in the base, angular rows first, columns in the order of the joints given."""
        vectors = self.values(q, qd, qdd)
        f = self.model.getFrameId(link, pin.FrameType.BODY)
        whole = pin.computeFrameJacobian(self.model, self.data, vectors[0], f, AXES)
        columns = [self.model.joints[self.model.getJointId(name)].idx_v for name in joints]
        return np.concatenate([whole[3:], whole[:3]])[:, columns]
