"""Newton-Euler engines on the opened mechanism, projected through its closure.

The loops are cut at the platform points: each leg is a chain of three joints, or in a plane of two,
and the platform a chain of its own. Joint angles come from triangles; the engine's own kinematics
tell how well the cuts close. Rates and accelerations come from its point Jacobians and their drift,
and the tree's forces T^T tau from the natural orthogonal complement T of those Jacobians.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from descriptions import Body, describe, places
from scipy.linalg import block_diag


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

    @property
    def size(self):
        return sum(len(link.joints) for link in self.links)


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
    """Return the same of a thin rod along x, whose spin has no inertia."""
    mass, center, axes, _ = planar(body, x, z)
    return mass, center, axes, np.array([0.0, body.about_center, body.about_center])


def chains(machine):
    """Return the legs' chains and the platform's, which must not slide."""
    x, _, k = machine.frame.T
    points = [machine.frame @ leg.s0 for leg in machine.legs]
    joints = [slide(axis) for axis in machine.moves.T] + [hinge(k)] * machine.turns
    platform = Chain([Link(joints, np.zeros(3), *planar(whole_platform(machine), x, k))], points)
    return [*(leg_chain(leg) for leg in machine.legs), platform]


def whole_platform(machine):
    """Return the platform with its bars as masses at their hinges, and with what its gears turn."""
    m, hx, hy, inertia = machine.platform.moments
    for mass, (x, y, _) in machine.bars:
        m, hx, hy, inertia = m + mass, hx + mass * x, hy + mass * y, inertia + mass * (x**2 + y**2)
    return Body(m, hx / m, hy / m, inertia + sum(ratio**2 * i for i, ratio in machine.geared))


def leg_chain(leg):
    """Return a leg's chain; where its joints are zero its links point along `first`."""
    a, b, d, at = leg.first, leg.second, leg.d, leg.r
    swing = [hinge(d), hinge(b)]
    if leg.ratio is not None:
        upper = Link(swing, at, *rod(leg.upper, a, d))
        return Chain([upper, Link([slide(a)], np.zeros(3), *rod(leg.lower, a, d))], [np.zeros(3)])
    links = []
    if leg.e is not None:
        ones = np.ones(3)
        links.append(Link([slide(leg.e)], at, leg.slider_mass, 0 * ones, np.eye(3), 1e-6 * ones))
        at = np.zeros(3)
    if leg.upper is not None:
        links.append(Link([hinge(d)], at, *planar(leg.upper, a, d)))
        at = leg.lu * a
    mass, center, *inertia = (planar if leg.flat else rod)(leg.lower, a, d)
    last = [hinge(d)] if leg.flat else swing
    links.append(Link(last, at, mass, center + leg.ll * a, *inertia))
    return Chain(links, [leg.ll * a])


def coordinates(machine):
    """Return the function from the pose to the tree's coordinates: the chains' in order."""
    x = ca.SX.sym("x", machine.freedom)
    pairs = zip(machine.legs, places(machine, x), strict=True)
    return ca.Function("coordinates", [x], [ca.vertcat(*(q for p in pairs for q in _leg(*p)), x)])


def _leg(leg, at):
    length = ca.norm_2(at.last)
    angle = ca.atan2(ca.dot(at.last, ca.DM(leg.second)), ca.dot(at.last, ca.DM(leg.first)))
    lean = -ca.asin(ca.dot(at.last, ca.DM(leg.d)) / length)
    if leg.ratio is not None:
        return [angle, lean, length]
    before = [q for q in (at.slide, at.angle) if q is not None]
    turn = angle if at.angle is None else angle - at.angle
    return [*before, turn] if leg.flat else [*before, turn, lean]


def actuated(machine):
    """Return the matrix from the tree's rates to those of the actuators."""
    sizes = [chain.size for chain in chains(machine)]
    found = np.zeros((len(machine.legs), sum(sizes)))
    for row, leg, at in zip(found, machine.legs, np.cumsum([0, *sizes]), strict=False):
        if leg.ratio is None:
            row[at] = 1.0
        else:
            row[-1] = leg.ratio
    return found


def closing(machine):
    """Return the matrix that takes the loops' gaps (3 n,) to those that count: not across a plane.

    A planar leg closes in the plane, and its own height does not count.
    """
    *legs, _ = chains(machine)
    return block_diag(*(np.eye(3) if leg.size == 3 else machine.moves.T for leg in legs))


def projected(robot, engine, pose, velocity, acceleration):
    """Return actuator forces (B, n) and J (B, n, m), and how far the engine's loops are open."""
    machine = describe(robot)
    positions, drives = coordinates(machine), actuated(machine)
    along = closing(machine)
    still = np.ravel([leg.t0 for leg in machine.legs])
    forces, jacobians, gaps = [], [], []
    for at, dx, ddx in zip(pose, velocity, acceleration, strict=True):
        q = np.array(positions(at)).ravel()
        legs, platform = np.split(along @ engine.jacobian(q), [len(along)], axis=1)
        gaps.append(along @ (engine.gap(q) - still))
        complement = np.vstack([-np.linalg.solve(legs, platform), np.eye(len(at))])
        dq, ddq = complement @ dx, complement @ ddx
        ddq[: len(along)] -= np.linalg.solve(legs, along @ engine.drift(q, dq))
        jacobians.append(drives @ complement)
        tree_forces = complement.T @ engine.inverse(q, dq, ddq)
        forces.append(np.linalg.solve(jacobians[-1].T, tree_forces))
    return np.array(forces), np.array(jacobians), np.abs(gaps).max()


class Pinocchio:
    """The tree in Pinocchio."""

    def __init__(self, robot):
        import pinocchio as pin

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

    def _opened(self, value):
        """Return the differences of a value, (3, ...), at the legs' ends and the platform's."""
        *legs, platform = self.frames
        return np.concatenate([value(a) - value(b) for (a,), b in zip(legs, platform, strict=True)])

    def gap(self, q):
        self.pin.framesForwardKinematics(self.model, self.data, q)
        return self._opened(lambda f: self.data.oMf[f].translation)

    def jacobian(self, q):
        self.pin.computeJointJacobians(self.model, self.data, q)
        world = self.pin.LOCAL_WORLD_ALIGNED
        return self._opened(
            lambda f: self.pin.getFrameJacobian(self.model, self.data, f, world)[:3]
        )

    def drift(self, q, dq):
        self.pin.forwardKinematics(self.model, self.data, q, dq, np.zeros_like(dq))
        acceleration, world = self.pin.getFrameClassicalAcceleration, self.pin.LOCAL_WORLD_ALIGNED
        return self._opened(lambda f: acceleration(self.model, self.data, f, world).linear)

    def inverse(self, q, dq, ddq):
        return self.pin.rnea(self.model, self.data, q, dq, ddq)


class MuJoCo:
    """The tree in MuJoCo, without equality constraints (those are soft, its tree is exact)."""

    def __init__(self, robot):
        import mujoco

        machine = describe(robot)
        self.mujoco = mujoco
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        spec.option.gravity = machine.gravity
        points, moments = [], []
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
                    inertia=np.maximum(link.moments, 2e-15),
                    explicitinertial=True,
                )
                moments.append(link.moments)
                for slides, axis in link.joints:
                    kind = mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
                    parent.add_joint(type=kind, axis=axis)
            points.append([parent.add_site(pos=point) for point in chain.points])
        self.model = spec.compile()
        # The compiler refuses moments that are zero, a rod's about itself; the dynamics do not.
        self.model.body_inertia[1:] = moments
        self.data = mujoco.MjData(self.model)
        self.sites = [[site.id for site in group] for group in points]

    def _opened(self, value):
        *legs, platform = self.sites
        return np.concatenate([value(a) - value(b) for (a,), b in zip(legs, platform, strict=True)])

    def _place(self, q, dq=0.0, ddq=0.0):
        self.data.qpos[:], self.data.qvel[:], self.data.qacc[:] = q, dq, ddq
        self.mujoco.mj_inverse(self.model, self.data)

    def gap(self, q):
        self._place(q)
        return self._opened(lambda s: self.data.site_xpos[s])

    def jacobian(self, q):
        self._place(q)

        def linear(site):
            jac = np.zeros((3, self.model.nv))
            self.mujoco.mj_jacSite(self.model, self.data, jac, None, site)
            return jac

        return self._opened(linear)

    def drift(self, q, dq):
        self._place(q, dq)

        def drift(site):
            jac = np.zeros((3, self.model.nv))
            body = self.model.site_bodyid[site]
            point = self.data.site_xpos[site]
            self.mujoco.mj_jacDot(self.model, self.data, jac, None, point, body)
            return jac @ dq

        return self._opened(drift)

    def inverse(self, q, dq, ddq):
        self._place(q, dq, ddq)
        return self.data.qfrc_inverse.copy()
