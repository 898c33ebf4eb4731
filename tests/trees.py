"""Newton-Euler engines on the opened mechanism, projected through its closure.

The loops are cut at the platform points: each leg is a chain slider, R1, R2, and the platform a
chain of its own. Joint angles come from the engine's tree; that the cut closes is asserted with the
engine's own kinematics. Rates and accelerations come from its point Jacobians and their drift, and
the tree's forces T^T tau from the natural orthogonal complement T of those Jacobians.
"""

from dataclasses import dataclass

import numpy as np

import pteron


@dataclass(frozen=True)
class Body:
    """A body of a chain: its joints to the body before, and its inertia in base axes at rest.

    Several joints at one place, none of them with a body of its own: MuJoCo wants mass on every
    body that moves, and a mass made up for it would be seen in the forces.
    """

    joints: list
    offset: np.ndarray
    mass: float
    center: np.ndarray
    inertia: np.ndarray


@dataclass(frozen=True)
class Chain:
    """A chain from the base, and the points of its last body where loops were cut."""

    bodies: list
    points: list


def slide(axis):
    return True, np.array(axis)


def hinge(axis):
    return False, np.array(axis)


def plane_axis(leg):
    a = np.cross(leg.direction, np.eye(3)[np.argmin(np.abs(leg.direction))])
    return a / np.linalg.norm(a)


def planar(body, x, z):
    """Return mass, centre and a spatial inertia that has the planar one about z, of a real body."""
    y = np.cross(z, x)
    gx, gy = body.center_of_mass
    about_center = body.inertia - body.mass * (gx**2 + gy**2)
    axes = np.column_stack([x, y, z])
    # Any Ixx and Iyy will do for the forces; those of a real body satisfy the engines' checks.
    spatial = axes @ np.diag([0.6 * about_center, 0.7 * about_center, about_center]) @ axes.T
    return body.mass, gx * x + gy * y, spatial


def chains(robot):
    """Return the legs' chains and the platform's."""
    found = []
    for leg in robot.legs:
        a, d = plane_axis(leg), np.array(leg.direction)
        turning = [hinge(d)]
        slider = (leg.slider_mass, np.zeros(3), 1e-6 * np.eye(3))
        mass, center, spatial = planar(leg.lower, a, d)
        lower = (mass, center + leg.lower_length * a, spatial)
        bodies = [
            Body([slide(leg.e)], np.array(leg.guide_point), *slider),
            Body(turning, np.zeros(3), *planar(leg.upper, a, d)),
            Body(turning, leg.upper_length * a, *lower),
        ]
        found.append(Chain(bodies, [leg.lower_length * a]))
    x, y, k = (np.array(axis) for axis in robot.platform.frame)
    inertia = planar(robot.platform.inertia, x, k)
    frame = np.column_stack([x, y, k])
    points = [frame @ leg.platform_point for leg in robot.legs]
    joints = [slide(axis) for axis in np.eye(3)] + ([hinge(k)] if robot.platform.turns else [])
    found.append(Chain([Body(joints, np.zeros(3), *inertia)], points))
    return found


def tree_position(robot, pose):
    """Return the tree's coordinates: slider, angle of R1 and of R2 for each leg, then the pose."""
    sliders = pteron.inverse_kinematics(robot, pose)
    upper, lower = pteron.link_vectors(robot, pose)
    q = []
    for leg, rho, l_u, l_l in zip(robot.legs, sliders, upper, lower, strict=True):
        a = plane_axis(leg)
        b = np.cross(leg.direction, a)
        theta_u, theta_l = np.arctan2(l_u @ b, l_u @ a), np.arctan2(l_l @ b, l_l @ a)
        q += [rho, theta_u, theta_l - theta_u]
    return np.array([*q, *pose])


def projected_forces(robot, engine, pose, velocity, acceleration):
    """Return the actuator forces, and how far the engine's own closure is from closing."""
    n = len(robot.legs)
    q = tree_position(robot, pose)
    leg_points, platform_points = engine.points(q)
    closing = np.abs(leg_points - platform_points).max()
    leg_jacobians, platform_jacobians = engine.jacobians(q)
    complement = np.zeros((len(q), len(pose)))
    complement[3 * n :] = np.eye(len(pose))
    for i in range(n):
        own = leg_jacobians[i][:, 3 * i : 3 * i + 3]
        complement[3 * i : 3 * i + 3] = np.linalg.solve(own, platform_jacobians[i][:, 3 * n :])
    dq = complement @ velocity
    leg_drift, platform_drift = engine.drifts(q, dq)
    ddq = complement @ acceleration
    for i in range(n):
        own = leg_jacobians[i][:, 3 * i : 3 * i + 3]
        ddq[3 * i : 3 * i + 3] += np.linalg.solve(own, platform_drift[i] - leg_drift[i])
    tau = engine.inverse(q, dq, ddq)
    return np.linalg.solve(complement[: 3 * n : 3].T, complement.T @ tau), closing


class Pinocchio:
    """The tree in Pinocchio."""

    def __init__(self, robot):
        import pinocchio as pin

        self.pin = pin
        model = pin.Model()
        model.gravity.linear = np.array(robot.gravity)
        self.frames = []
        for k, chain in enumerate(chains(robot)):
            parent = 0
            for j, body in enumerate(chain.bodies):
                place = pin.SE3(np.eye(3), body.offset)
                for i, (slides, axis) in enumerate(body.joints):
                    kind = (
                        pin.JointModelPrismaticUnaligned
                        if slides
                        else pin.JointModelRevoluteUnaligned
                    )
                    parent = model.addJoint(parent, kind(axis), place, f"joint {k} {j} {i}")
                    place = pin.SE3.Identity()
                inertia = pin.Inertia(body.mass, body.center, body.inertia)
                model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
            self.frames.append(
                [
                    model.addFrame(
                        pin.Frame(f"point {k} {j}", parent, pin.SE3(np.eye(3), point), pin.OP_FRAME)
                    )
                    for j, point in enumerate(chain.points)
                ]
            )
        self.model, self.data = model, model.createData()

    def _pairs(self, value):
        *legs, platform = self.frames
        return [value(f) for (f,) in legs], [value(f) for f in platform]

    def points(self, q):
        self.pin.framesForwardKinematics(self.model, self.data, q)
        legs, platform = self._pairs(lambda f: self.data.oMf[f].translation.copy())
        return np.array(legs), np.array(platform)

    def jacobians(self, q):
        self.pin.computeJointJacobians(self.model, self.data, q)
        self.pin.updateFramePlacements(self.model, self.data)
        world = self.pin.LOCAL_WORLD_ALIGNED
        return self._pairs(
            lambda f: self.pin.getFrameJacobian(self.model, self.data, f, world)[:3].copy()
        )

    def drifts(self, q, dq):
        self.pin.forwardKinematics(self.model, self.data, q, dq, np.zeros_like(dq))
        world = self.pin.LOCAL_WORLD_ALIGNED
        return self._pairs(
            lambda f: self.pin.getFrameClassicalAcceleration(
                self.model, self.data, f, world
            ).linear.copy()
        )

    def inverse(self, q, dq, ddq):
        return self.pin.rnea(self.model, self.data, q, dq, ddq)


class MuJoCo:
    """The tree in MuJoCo, without equality constraints (those are soft, its tree is exact)."""

    def __init__(self, robot):
        import mujoco

        self.mujoco = mujoco
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        spec.option.gravity = robot.gravity
        self.points_of = []
        for chain in chains(robot):
            parent = spec.worldbody
            for body in chain.bodies:
                parent = parent.add_body(
                    pos=body.offset,
                    mass=body.mass,
                    ipos=body.center,
                    fullinertia=body.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]],
                    explicitinertial=True,
                )
                for slides, axis in body.joints:
                    kind = mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
                    parent.add_joint(type=kind, axis=axis)
            self.points_of.append([parent.add_site(pos=point) for point in chain.points])
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.sites = [[site.id for site in group] for group in self.points_of]

    def _place(self, q, dq=None, ddq=None):
        self.data.qpos[:] = q
        self.data.qvel[:] = 0.0 if dq is None else dq
        self.data.qacc[:] = 0.0 if ddq is None else ddq
        self.mujoco.mj_inverse(self.model, self.data)

    def _pairs(self, value):
        *legs, platform = self.sites
        return [value(s) for (s,) in legs], [value(s) for s in platform]

    def points(self, q):
        self._place(q)
        legs, platform = self._pairs(lambda s: self.data.site_xpos[s].copy())
        return np.array(legs), np.array(platform)

    def jacobians(self, q):
        self._place(q)

        def linear(site):
            jac = np.zeros((3, self.model.nv))
            self.mujoco.mj_jacSite(self.model, self.data, jac, None, site)
            return jac

        return self._pairs(linear)

    def drifts(self, q, dq):
        self._place(q, dq)

        def drift(site):
            jac = np.zeros((3, self.model.nv))
            body = self.model.site_bodyid[site]
            point = self.data.site_xpos[site]
            self.mujoco.mj_jacDot(self.model, self.data, jac, None, point, body)
            return jac @ dq

        return self._pairs(drift)

    def inverse(self, q, dq, ddq):
        self._place(q, dq, ddq)
        return self.data.qfrc_inverse.copy()
