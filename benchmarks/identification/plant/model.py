"""A parallel robot in MuJoCo: legs and platform are chains of their own, closed by constraints.

Nothing here is Pteron's: MuJoCo has the bodies in space, finds the passive joints' motion by
itself, and its constraint forces carry what the legs do to the platform.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import pteron
from pteron.bodies.inertia import RodInertia

__all__ = ["Array", "first_joint", "joint_damping", "leg_coordinates", "loop_rows", "mujoco_model"]

Array = NDArray[np.float64]
"""Floats of any shape."""

_IMPEDANCE = 0.9999
"""The most MuJoCo allows: the share of an unwanted acceleration that a constraint takes away."""

_RATE = 1000.0
"""The constraints pull gaps back like critically damped oscillators, rad/s.

A load that would part two points at 100 m/s^2 leaves (1 - 0.9999) 100 / 1000^2 = 1e-8 m open. Much
stiffer ones are worse: with the rate at 1 / step, Runge and Kutta's intermediate stages, which are
off the closed loops by step^2, gave force errors of 3e-4 whatever the step; at a fifth, 1e-6.
"""

_PARALLEL = 1.0 - 1e-12

_SPIN = 1e-9
"""kg m^2 that a rod has about its own axis: it hardly spins, but MuJoCo wants a body."""

_COINCIDENT = 1e-9


def mujoco_model(robot: pteron.Manipulator, step: float) -> Any:
    """Return the model: its coordinates are the pose, what gears turn, where bars are, the legs.

    Each leg has three: slider, R1 and R2; or crank, and the angles of the universal joint between
    it and its rod. Its constraints are first the loops', three rows for each leg, then three for
    each bar's hinge and one for each gear, then those that can hold an actuated joint that sticks,
    which are not active.

    Parameters
    ----------
    robot : Manipulator
        The machine, with its real inertia; of P-R-R-R or R-S-S legs.
    step : float
        Step of the integration, s.

    Returns
    -------
    mujoco.MjModel
    """
    import mujoco

    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    option = spec.option
    option.gravity = robot.gravity
    option.timestep = step
    option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.tolerance = 1e-14
    option.iterations = 20
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE

    # The platform, what gears turn on it, and bars, which only translate
    frame = np.column_stack(robot.platform.frame)
    axis = robot.platform.axis
    platform = _body(spec.worldbody, robot.platform.inertia, np.zeros(3), frame, 0.0)
    for direction in np.eye(3):
        platform.add_joint(type=slide, axis=direction)
    if robot.platform.turns:
        platform.add_joint(name="turn", type=hinge, axis=axis)
    for i, part in enumerate(robot.platform.geared):
        tool = platform.add_body(mass=1e-9, inertia=np.full(3, part.inertia), explicitinertial=True)
        tool.add_joint(name=f"gear {i}", type=hinge, axis=axis)
    bars = []
    for i, bar in enumerate(robot.platform.bars):
        place = frame @ bar.hinge
        bars.append(
            spec.worldbody.add_body(
                pos=place, mass=bar.mass, inertia=np.full(3, 1e-3), explicitinertial=True
            )
        )
        for direction in np.eye(3):
            bars[-1].add_joint(type=slide, axis=direction)
        bars[-1].add_site(name=f"bar {i}")
        platform.add_site(name=f"hinge {i}", pos=place)

    # The legs
    for i, leg in enumerate(robot.legs):
        last, end = _leg(spec.worldbody, leg, f"actuated {i}")
        last.add_site(name=f"leg {i}", pos=end)
        carrier, place = platform, frame @ leg.platform_point
        if any(leg.fixed_offset):
            carrier, place = bars[_bar_of(robot, leg)], np.array(leg.fixed_offset)
        carrier.add_site(name=f"platform {i}", pos=place)

    # What closes and holds
    pull = {"solref": [-(_RATE**2), -2.0 * _RATE], "solimp": [_IMPEDANCE, _IMPEDANCE, 1e-3, 0.5, 2]}
    pairs = [(f"leg {i}", f"platform {i}") for i in range(len(robot.legs))]
    pairs += [(f"bar {i}", f"hinge {i}") for i in range(len(bars))]
    for one, other in pairs:
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_CONNECT,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            name1=one,
            name2=other,
            **pull,
        )
    joint = {"type": mujoco.mjtEq.mjEQ_JOINT, "objtype": mujoco.mjtObj.mjOBJ_JOINT, **pull}
    for i, part in enumerate(robot.platform.geared):
        # Against the platform it turns by (ratio - 1) phi.
        data = np.r_[0.0, part.ratio - 1.0, np.zeros(10)]
        spec.add_equality(name1=f"gear {i}", name2="turn", data=data, **joint)
    for i in range(len(robot.legs)):
        spec.add_equality(name1=f"actuated {i}", active=False, data=np.zeros(12), **joint)
    return spec.compile()


def first_joint(robot: pteron.Manipulator) -> int:
    """Return which coordinate is the first leg's actuated joint; the next ones follow by threes."""
    return robot.freedom + len(robot.platform.geared) + 3 * len(robot.platform.bars)


def loop_rows(robot: pteron.Manipulator) -> int:
    """Return how many rows the constraints have that are always active."""
    return 3 * (len(robot.legs) + len(robot.platform.bars)) + len(robot.platform.geared)


def _leg(world: Any, leg: Any, name: str) -> tuple[Any, Array]:
    """Add a leg, its actuated joint of a name; return its last body and where on it the end is."""
    import mujoco

    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    axes, z = _axes(leg), [0.0, 0.0, 1.0]
    elbow, upright = np.array([leg.upper_length, 0.0, 0.0]), np.eye(3)
    if isinstance(leg, pteron.Leg):
        slider = world.add_body(
            pos=leg.guide_point,
            quat=_quaternion(axes),
            mass=leg.slider_mass,
            inertia=np.full(3, 1e-6),  # it does not turn, but MuJoCo wants a body
            explicitinertial=True,
        )
        slider.add_joint(name=name, type=slide, axis=axes.T @ np.array(leg.e))
        upper = _body(slider, leg.upper, np.zeros(3), upright, 0.0)
        upper.add_joint(type=hinge, axis=z)
    else:
        upper = _body(world, leg.upper, np.array(leg.guide_point), upright, 0.0, axes)
        upper.add_joint(name=name, type=hinge, axis=z)
    lower = _body(upper, leg.lower, elbow, upright, leg.lower_length)
    lower.add_joint(type=hinge, axis=z)
    if not isinstance(leg, pteron.Leg):
        lower.add_joint(type=hinge, axis=[0.0, 1.0, 0.0])
    return lower, np.array([leg.lower_length, 0.0, 0.0])


def leg_coordinates(robot: pteron.Manipulator, pose: Array) -> Array:
    """Return the coordinates (..., 3 n) of the legs at poses (..., m)."""
    upper, lower = pteron.link_vectors(robot, pose)
    joints = pteron.inverse_kinematics(robot, pose)
    found = []
    legs: tuple[Any, ...] = robot.legs
    for i, leg in enumerate(legs):
        u, v = (link[..., i, :] @ _axes(leg) for link in (upper, lower))
        turns = [np.arctan2(link[..., 1], link[..., 0]) for link in (u, v)]
        if isinstance(leg, pteron.Leg):
            found += [joints[..., i], turns[0], turns[1] - turns[0]]
        else:
            found += [
                joints[..., i],
                turns[1] - joints[..., i],
                -np.arcsin(v[..., 2] / leg.lower_length),
            ]
    return np.stack(found, axis=-1)


def joint_damping(robot: pteron.Manipulator) -> Array:
    """Return C: passive joints with a unit coefficient load the coordinates with -C q'.

    What is beyond the constraints is told by what is before them. R3 of a P-R-R-R leg turns at
    -theta_l', or at phi' - theta_l' about d where d is parallel to k and no R4 follows; every R4
    turns at phi'. The end of a rod turns as its tip does, back, and its hinge at phi'.
    """
    n, first = len(robot.legs), first_joint(robot)
    unit = np.eye(first + 3 * n)
    turn = unit[robot.freedom - 1]
    rows = []
    for i, leg in enumerate(robot.legs):
        actuated, upper, lower = unit[first + 3 * i : first + 3 * i + 3]
        rows += [upper, lower]
        if isinstance(leg, pteron.Leg):
            along = float(np.dot(leg.direction, robot.platform.axis))
            if robot.platform.turns and abs(along) > _PARALLEL:
                rows.append(np.sign(along) * turn - upper - lower)
                continue
            rows.append(-upper - lower)
        else:
            rows += [-lower, -actuated - upper]
        if robot.platform.turns:
            rows.append(turn)
    rates = np.array(rows)
    damping: Array = rates.T @ rates
    return damping


def _axes(leg: Any) -> Array:
    """Return the axes (3, 3), as columns, of a leg's frame: z along d, x where a crank begins."""
    d = np.array(leg.direction)
    if isinstance(leg, pteron.Leg):
        x = np.cross(d, np.eye(3)[np.argmin(np.abs(d))])
        x /= np.linalg.norm(x)
    else:
        x = np.array(leg.zero_direction)
    return np.column_stack([x, np.cross(d, x), d])


def _bar_of(robot: pteron.Manipulator, leg: Any) -> int:
    """Return the bar that carries a leg's end."""
    hinges = np.array([bar.hinge for bar in robot.platform.bars])
    apart = np.linalg.norm(hinges - leg.platform_point, axis=-1)
    if apart.min(initial=np.inf) > _COINCIDENT:
        raise NotImplementedError("the plant's legs with a fixed offset end on a bar's hinge")
    return int(apart.argmin())


def _body(
    parent: Any, inertia: Any, place: Array, frame: Array, reach: float, axes: Array | None = None
) -> Any:
    """Add a body whose parameters are about a point at `reach` along its x, in axes of its own."""
    gamma = np.array([*inertia.center_of_mass, 0.0, 0.0])[:3]
    about_center = inertia.inertia - inertia.mass * float(gamma @ gamma)
    # Only the last one acts in the plane.
    moments = np.array([0.6, 0.7, 1.0]) * about_center
    if isinstance(inertia, RodInertia):
        moments = np.array([_SPIN, about_center, about_center])
    return parent.add_body(
        pos=place,
        quat=_quaternion(np.eye(3) if axes is None else axes),
        mass=inertia.mass,
        ipos=frame @ (gamma + np.array([reach, 0.0, 0.0])),
        iquat=_quaternion(frame),
        inertia=moments,
        explicitinertial=True,
    )


def _quaternion(rotation: Array) -> Array:
    import mujoco

    found = np.empty(4)
    mujoco.mju_mat2Quat(found, np.ascontiguousarray(rotation).ravel())
    return found
