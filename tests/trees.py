"""Newton-Euler engines on the opened mechanism, projected through its closure.

The loops are cut at the platform points: each leg is a chain of three joints (slider, R1, R2; or a
crank and the two hinges of a universal joint), and the platform a chain of its own. Joint angles
come from triangles; that the cut closes is asserted with the engine's own kinematics. Rates and
accelerations come from its point Jacobians and their drift, and the tree's forces T^T tau from the
natural orthogonal complement T of those Jacobians.
"""

from dataclasses import dataclass

import numpy as np
from descriptions import describe, leg_angles, platform_points


@dataclass(frozen=True)
class Link:
    """A body of a chain: its joints to the body before, and its inertia, in base axes at rest.

    `axes` are those of the moments of inertia about the centre, as columns.
    Several joints at one place, none of them with a body of its own: MuJoCo wants mass on every
    body that moves, and a mass made up for it would be seen in the forces.
    """

    joints: list
    offset: np.ndarray
    mass: float
    center: np.ndarray
    axes: np.ndarray
    moments: np.ndarray


@dataclass(frozen=True)
class Chain:
    """A chain from the base, and the points of its last body where loops were cut."""

    links: list
    points: list


def slide(axis):
    return True, np.array(axis)


def hinge(axis):
    return False, np.array(axis)


def planar(body, x, z):
    """Return mass, centre, axes and moments of a real body that has the planar moment about z."""
    y = np.cross(z, x)
    # Any Ixx and Iyy will do for the forces; those of a real body satisfy the engines' checks.
    moments = body.about_center * np.array([0.6, 0.7, 1.0])
    return body.mass, body.x * x + body.y * y, np.column_stack([x, y, z]), moments


def rod(body, x, z):
    """Return the same of a thin rod along x, whose spin has (for MuJoCo next to) no inertia."""
    mass, center, axes, _ = planar(body, x, z)
    return mass, center, axes, np.array([2e-15, body.about_center, body.about_center])


def chains(machine):
    """Return the legs' chains and the platform's."""
    found, ones = [], np.ones(3)
    for leg in machine.legs:
        a, d = leg.first, leg.d
        upper = planar(leg.upper, a, d)
        mass, center, *inertia = (rod if leg.crank else planar)(leg.lower, a, d)
        lower = leg.lu * a, mass, center + leg.ll * a, *inertia
        if leg.crank:
            links = [
                Link([hinge(d)], leg.r, *upper),
                Link([hinge(d), hinge(leg.second)], *lower),
            ]
        else:
            links = [
                Link([slide(leg.e)], leg.r, leg.slider_mass, np.zeros(3), np.eye(3), 1e-6 * ones),
                Link([hinge(d)], np.zeros(3), *upper),
                Link([hinge(d)], *lower),
            ]
        found.append(Chain(links, [leg.ll * a]))
    x, _, k = machine.frame.T
    points = [machine.frame @ leg.s0 for leg in machine.legs]
    joints = [slide(axis) for axis in np.eye(3)] + ([hinge(k)] if machine.turns else [])
    found.append(Chain([Link(joints, np.zeros(3), *planar(machine.platform, x, k))], points))
    return found


def tree_position(machine, pose):
    """Return the tree's coordinates: three of each leg, then the pose."""
    q = []
    for leg, c in zip(machine.legs, platform_points(machine, pose), strict=True):
        slide, upper, last = leg_angles(leg, c)
        lower = np.arctan2(last @ leg.second, last @ leg.first)
        if leg.crank:
            q += [upper, lower - upper, -np.arcsin(last @ leg.d / leg.ll)]
        else:
            q += [slide, upper, lower - upper]
    return np.array([*q, *pose])


def projected_forces(robot, engine, pose, velocity, acceleration):
    """Return the actuator forces, and how far the engine's own closure is from closing."""
    machine = describe(robot)
    n = len(machine.legs)
    q = tree_position(machine, pose)
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

        machine = describe(robot)
        machine = describe(robot)
        self.pin = pin
        model = pin.Model()
        model.gravity.linear = machine.gravity
        self.frames = []
        for k, chain in enumerate(chains(machine)):
            parent = 0
            for j, link in enumerate(chain.links):
                place = pin.SE3(np.eye(3), link.offset)
                for i, (slides, axis) in enumerate(link.joints):
                    kind = (
                        pin.JointModelPrismaticUnaligned
                        if slides
                        else pin.JointModelRevoluteUnaligned
                    )
                    parent = model.addJoint(parent, kind(axis), place, f"joint {k} {j} {i}")
                    place = pin.SE3.Identity()
                inertia = link.axes @ np.diag(link.moments) @ link.axes.T
                inertia = pin.Inertia(link.mass, link.center, inertia)
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

        machine = describe(robot)
        machine = describe(robot)
        self.mujoco = mujoco
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        spec.option.gravity = machine.gravity
        self.points_of = []
        for chain in chains(machine):
            parent = spec.worldbody
            for link in chain.links:
                quaternion = np.empty(4)
                mujoco.mju_mat2Quat(quaternion, link.axes.ravel())
                parent = parent.add_body(
                    pos=link.offset,
                    mass=link.mass,
                    ipos=link.center,
                    iquat=quaternion,
                    inertia=link.moments,
                    explicitinertial=True,
                )
                for slides, axis in link.joints:
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
