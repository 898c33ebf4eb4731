"""A parallel robot in MuJoCo: legs and platform are chains of their own, closed by constraints.

Nothing here is Pteron's: MuJoCo has the bodies in space, finds the passive joints' motion by
itself, and its constraint forces carry what the legs do to the platform.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import pteron

__all__ = ["Array", "joint_damping", "leg_axes", "legs_of", "mujoco_model"]

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


def legs_of(robot: pteron.Manipulator) -> list[pteron.Leg]:
    """Return the legs; this plant is built of P-R-R-R legs alone."""
    legs = [leg for leg in robot.legs if isinstance(leg, pteron.Leg)]
    if len(legs) < len(robot.legs):
        raise NotImplementedError("the plant is built of P-R-R-R legs alone")
    return legs


def leg_axes(leg: pteron.Leg) -> Array:
    """Return the axes (3, 3), as columns, of a leg's frame: z along d, any x across it."""
    d = np.array(leg.direction)
    x = np.cross(d, np.eye(3)[np.argmin(np.abs(d))])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(d, x), d])


def mujoco_model(robot: pteron.Manipulator, step: float) -> Any:
    """Return the model; its coordinates are the pose, then slider, R1 and R2 of each leg.

    Its constraints are first the loops', three rows for each leg, then those that can hold a slider
    that sticks, which are not active.

    Parameters
    ----------
    robot : Manipulator
        The machine, with its real inertia.
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
    platform = _platform(spec.worldbody, robot)
    for axis in np.eye(3):
        platform.add_joint(type=slide, axis=axis)
    if robot.platform.turns:
        platform.add_joint(type=hinge, axis=robot.platform.axis)
    frame = np.column_stack(robot.platform.frame)
    pull, impedance = [-(_RATE**2), -2.0 * _RATE], [_IMPEDANCE, _IMPEDANCE, 1e-3, 0.5, 2.0]
    for i, leg in enumerate(legs_of(robot)):
        axes = leg_axes(leg)
        slider = spec.worldbody.add_body(
            pos=leg.guide_point,
            quat=_quaternion(axes),
            mass=leg.slider_mass,
            inertia=np.full(3, 1e-6),  # it does not turn, but MuJoCo wants a body
            explicitinertial=True,
        )
        slider.add_joint(name=f"slider {i}", type=slide, axis=axes.T @ np.array(leg.e))
        upper = _link(slider, leg.upper, np.zeros(3), 0.0)
        elbow = np.array([leg.upper_length, 0.0, 0.0])
        lower = _link(upper, leg.lower, elbow, leg.lower_length)
        for link in (upper, lower):
            link.add_joint(type=hinge, axis=[0.0, 0.0, 1.0])
        lower.add_site(name=f"leg {i}", pos=[leg.lower_length, 0.0, 0.0])
        platform.add_site(name=f"platform {i}", pos=frame @ leg.platform_point)
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_CONNECT,
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            name1=f"leg {i}",
            name2=f"platform {i}",
            solref=pull,
            solimp=impedance,
        )
    for i in range(len(robot.legs)):
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_JOINT,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            name1=f"slider {i}",
            active=False,
            data=np.zeros(12),
            solref=pull,
            solimp=impedance,
        )
    return spec.compile()


def joint_damping(robot: pteron.Manipulator) -> Array:
    """Return C (3 n + m, 3 n + m): passive joints with a unit coefficient load with -C q'.

    R3 and R4 are where the constraints are. R3 turns at -theta_l', or at phi' - theta_l' about d
    where d is parallel to k and no R4 follows; every R4 turns at phi'.
    """
    n, m = len(robot.legs), robot.freedom
    rows = []
    for i, leg in enumerate(legs_of(robot)):
        upper, relative, turn = np.eye(3 * n + m)[[m + 3 * i + 1, m + 3 * i + 2, m - 1]]
        lower = upper + relative
        along = float(np.dot(leg.direction, robot.platform.axis))
        rows += [upper, relative]
        if not robot.platform.turns:
            rows.append(-lower)
        elif abs(along) > _PARALLEL:
            rows.append(np.sign(along) * turn - lower)
        else:
            rows += [-lower, turn]
    rates = np.array(rows)
    damping: Array = rates.T @ rates
    return damping


def _platform(world: Any, robot: pteron.Manipulator) -> Any:
    frame = np.column_stack(robot.platform.frame)
    mass, center, moments = _spatial(robot.platform.inertia)
    return world.add_body(
        mass=mass,
        ipos=frame @ center,
        iquat=_quaternion(frame),
        inertia=moments,
        explicitinertial=True,
    )


def _link(parent: Any, planar: pteron.PlanarInertia, place: Array, reach: float) -> Any:
    """Add a link whose parameters are about a point at `reach` along its x."""
    mass, center, moments = _spatial(planar)
    return parent.add_body(
        pos=place,
        mass=mass,
        ipos=center + np.array([reach, 0.0, 0.0]),
        inertia=moments,
        explicitinertial=True,
    )


def _spatial(planar: pteron.PlanarInertia) -> tuple[float, Array, Array]:
    """Return mass, centre and moments about the centre; only the last one acts in the plane."""
    gx, gy = planar.center_of_mass
    about_center = planar.inertia - planar.mass * (gx**2 + gy**2)
    return planar.mass, np.array([gx, gy, 0.0]), about_center * np.array([0.6, 0.7, 1.0])


def _quaternion(rotation: Array) -> Array:
    import mujoco

    found = np.empty(4)
    mujoco.mju_mat2Quat(found, np.ascontiguousarray(rotation).ravel())
    return found
