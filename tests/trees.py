"""Newton-Euler engines on the exported files, projected through the closure of their loops.

The files' loops are cut where `pteron.export.tree` cuts them; an engine reads a file and computes
with it alone. Its own kinematics tell how well the cuts close at the coordinates that pteron gives.
Rates and accelerations come from its point Jacobians and their drift, and the tree's forces
T^T tau from the natural orthogonal complement T of those Jacobians: nothing of pteron's dynamics is
in them.
"""

import re
from dataclasses import replace

import numpy as np

from pteron.export.engines import coordinates, mjcf, tree
from pteron.export.engines.pinocchio import pinocchio_model
from pteron.export.engines.sdf import sdf
from pteron.export.engines.urdf import closure_yaml, urdf

SPIN = 1e-9
"""A moment of inertia that is less of a body's greatest is one that the export made up for a rod's
spin. The sharpest comparison is without it."""


def without_drives(robot):
    """Return the machine with its rigid bodies alone: engines add motors' inertia to theirs."""
    return replace(robot, legs=tuple(replace(leg, drive=None) for leg in robot.legs))


def projected(robot, engine, pose, velocity, acceleration):
    """Return actuator forces (B, n) and J (B, n, m), and how far the engine's loops are open."""
    opened = engine.opened
    names = [joint.name for joint in opened.joints]
    order = [names.index(name) for name in engine.names]
    homes = np.array([joint.home for joint in opened.joints])
    free = [engine.names.index(name) for name in robot.coordinates]
    bound = [k for k in range(len(order)) if k not in free]
    coupled = [joint for joint in opened.joints if joint.follows and joint.name in engine.names]
    rows = np.zeros((len(coupled), len(order)))
    for row, joint in zip(rows, coupled, strict=True):
        row[engine.names.index(joint.name)] = 1.0
        row[engine.names.index(joint.follows[0])] = -joint.follows[1]
    drives = np.zeros((len(opened.motors), len(order)))
    for row, motor in zip(drives, opened.motors, strict=True):
        row[engine.names.index(motor.joint)] = motor.ratio
    forces, jacobians, gaps = [], [], []
    places = coordinates(opened, pose) - (homes if engine.from_home else 0.0)
    for q, dx, ddx in zip(places[:, order], velocity, acceleration, strict=True):
        gaps.append(engine.gap(q))
        # A planar leg's height across its plane is no motion: its row is zero, and counts nothing.
        closing = np.vstack([engine.jacobian(q), rows])
        solve = np.linalg.pinv(closing[:, bound], rcond=1e-10)
        complement = np.zeros((len(order), len(free)))
        complement[free] = np.eye(len(free))
        complement[bound] = -solve @ closing[:, free]
        dq, ddq = complement @ dx, complement @ ddx
        drift = np.concatenate([engine.drift(q, dq), np.zeros(len(rows))])
        ddq[bound] -= solve @ drift
        jacobians.append(drives @ complement)
        tree_forces = complement.T @ engine.inverse(q, dq, ddq)
        # Of the least norm where there are more legs than coordinates.
        forces.append(np.linalg.pinv(jacobians[-1].T) @ tree_forces)
    return np.array(forces), np.array(jacobians), np.abs(gaps).max()


class MuJoCo:
    """The MJCF in MuJoCo, without its constraints (those are soft, its tree is exact)."""

    from_home = False

    def __init__(self, robot, home=None, spin=True):
        import mujoco

        self.mujoco = mujoco
        self.opened = tree(without_drives(robot), home)
        self.model = mujoco.MjModel.from_xml_string(mjcf(self.opened))
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        if not spin:
            inertia = self.model.body_inertia
            inertia[inertia < SPIN * inertia.max(axis=-1, keepdims=True)] = 0.0
        self.data = mujoco.MjData(self.model)
        self.names = [self.model.joint(k).name for k in range(self.model.njnt)]
        self.pairs = [
            [self.model.site(f"{closing.name}_{side}").id for side in ("end", "seat")]
            for closing in self.opened.closings
        ]

    def _opened(self, value):
        return np.concatenate([value(end) - value(seat) for end, seat in self.pairs])

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


class Pinocchio:
    """The model that the exported Python file builds, without its constraints."""

    from_home = False

    def __init__(self, robot, home=None, spin=True):
        import pinocchio as pin

        self.pin = pin
        robot = without_drives(robot)
        self.opened = tree(robot, home)
        self._take(pinocchio_model(robot, home=home).model)
        if not spin:
            for inertia in self.model.inertias:
                moments, axes = np.linalg.eigh(inertia.inertia)
                moments[moments < SPIN * moments.max()] = 0.0
                inertia.inertia = axes @ np.diag(moments) @ axes.T

    def _take(self, model):
        """Take a model whose bodies are frames, and add the points that are to be one."""
        pin = self.pin
        self.pairs = []
        for closing in self.opened.closings:
            ends = []
            for k, (body, point) in enumerate(self.points_of(closing)):
                frame = model.frames[model.getFrameId(body)]
                place = frame.placement * pin.SE3(np.eye(3), np.array(point))
                frame = pin.Frame(f"{closing.name} {k}", frame.parentJoint, place, pin.OP_FRAME)
                ends.append(model.addFrame(frame))
            self.pairs.append(ends)
        self.model, self.data = model, model.createData()
        # In the order of their velocities.
        self.names = list(model.names)[1:]

    def points_of(self, closing):
        for k in (closing.one, closing.other):
            body = self.opened.bodies[k]
            yield body.name, (closing.point - body.origin) @ body.axes

    def _q(self, q):
        # A joint that turns without end has two coordinates.
        return self.pin.integrate(self.model, self.pin.neutral(self.model), q)

    def _opened(self, value):
        return np.concatenate([value(end) - value(seat) for end, seat in self.pairs])

    def gap(self, q):
        self.pin.framesForwardKinematics(self.model, self.data, self._q(q))
        return self._opened(lambda f: self.data.oMf[f].translation)

    def jacobian(self, q):
        self.pin.computeJointJacobians(self.model, self.data, self._q(q))
        world = self.pin.LOCAL_WORLD_ALIGNED
        return self._opened(
            lambda f: self.pin.getFrameJacobian(self.model, self.data, f, world)[:3]
        )

    def drift(self, q, dq):
        self.pin.forwardKinematics(self.model, self.data, self._q(q), dq, np.zeros_like(dq))
        acceleration, world = self.pin.getFrameClassicalAcceleration, self.pin.LOCAL_WORLD_ALIGNED
        return self._opened(lambda f: acceleration(self.model, self.data, f, world).linear)

    def inverse(self, q, dq, ddq):
        return self.pin.rnea(self.model, self.data, self._q(q), dq, ddq)


class PinocchioURDF(Pinocchio):
    """The URDF in Pinocchio, with the points of its closure file."""

    def __init__(self, robot, home=None):
        import pinocchio as pin
        import yaml

        self.pin = pin
        self.opened = tree(without_drives(robot), home)
        closure = yaml.safe_load(closure_yaml(self.opened))
        self.closures = {closure_["name"]: closure_ for closure_ in closure["closures"]}
        model = pin.buildModelFromXML(urdf(self.opened))
        model.gravity.linear = np.array(closure["gravity"])
        self._take(model)
        for found, motor in zip(closure["motors"], self.opened.motors, strict=True):
            assert (found["name"], found["joint"]) == (motor.name, motor.joint)
            assert abs(found["ratio"] - motor.ratio) < 1e-14
        homes = [joint.home for joint in self.opened.joints]
        np.testing.assert_allclose(list(closure["home"].values()), homes, rtol=0, atol=1e-14)

    def points_of(self, closing):
        closure = self.closures[closing.name]
        return [(closure[side]["link"], closure[side]["point"]) for side in "ab"]


class Drake:
    """The SDF in Drake, which reads joints that close loops, but builds no machine with them."""

    from_home = True

    def __init__(self, robot, home=None):
        from pydrake.all import JacobianWrtVariable, MultibodyForces, MultibodyPlant, Parser

        self.forces, self.speeds = MultibodyForces, JacobianWrtVariable.kV
        self.opened = tree(without_drives(robot), home)
        text = sdf(self.opened)
        balls = re.findall(r'<joint name="\w+" type="ball">.*?</joint>', text, flags=re.S)
        self.plant = plant = MultibodyPlant(0.0)
        cut = text
        for ball in balls:
            cut = cut.replace(ball, "")
        Parser(plant).AddModelsFromString(cut, "sdf")
        plant.mutable_gravity_field().set_gravity_vector(np.array(self.opened.robot.gravity))
        plant.Finalize()
        self.context = plant.CreateDefaultContext()
        joints = [plant.get_joint(k) for k in plant.GetJointIndices()]
        joints = [joint for joint in joints if joint.num_velocities()]
        joints.sort(key=lambda joint: joint.velocity_start())
        self.names = [joint.name() for joint in joints]
        self.pairs = []
        for ball in balls:
            end, seat = (
                plant.GetBodyByName(re.search(f"<{kind}>(.*?)<", ball)[1]).body_frame()
                for kind in ("child", "parent")
            )
            place = np.array(re.search("<pose>(.*?)<", ball)[1].split(), dtype=float)[:3]
            # The file has the point in the child's frame; where the parent has it, its pose says.
            here = plant.CalcPointsPositions(self.context, end, place, seat).ravel()
            self.pairs.append([(end, place), (seat, here)])

    def _place(self, q, dq=None):
        self.plant.SetPositions(self.context, q)
        self.plant.SetVelocities(self.context, np.zeros_like(q) if dq is None else dq)

    def _opened(self, value):
        return np.concatenate([value(*end) - value(*seat) for end, seat in self.pairs])

    def gap(self, q):
        self._place(q)
        world = self.plant.world_frame()
        return self._opened(
            lambda f, p: self.plant.CalcPointsPositions(self.context, f, p, world).ravel()
        )

    def jacobian(self, q):
        self._place(q)
        world = self.plant.world_frame()
        return self._opened(
            lambda f, p: self.plant.CalcJacobianTranslationalVelocity(
                self.context, self.speeds, f, p, world, world
            )
        )

    def drift(self, q, dq):
        self._place(q, dq)
        world = self.plant.world_frame()
        return self._opened(
            lambda f, p: self.plant.CalcBiasTranslationalAcceleration(
                self.context, self.speeds, f, p, world, world
            ).ravel()
        )

    def inverse(self, q, dq, ddq):
        self._place(q, dq)
        forces = self.forces(self.plant)
        self.plant.CalcForceElementsContribution(self.context, forces)
        return self.plant.CalcInverseDynamics(self.context, ddq, forces)
