"""An independent derivation: Lagrange's equations by differentiation of energies.

Nothing of `pteron.equations` is used: positions come from trigonometry (law of cosines, atan2)
instead of the circle lemma, velocities and everything after from automatic differentiation. A body
turns with the direction of its x axis: a link's in its plane, a rod's without a spin of its own.
"""

from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from descriptions import describe


class Body(NamedTuple):
    """Its parameters, its reference point, and its axes.

    A slider has m and no axis, a rod m, mgx, I and x, others m, mgx, mgy, I and x, y.
    """

    parameters: tuple
    point: Any
    axes: tuple


def inverse_dynamics(robot):
    """Return a function of pose, velocity and acceleration that gives the actuator forces."""
    regressor_of = regressor(robot)
    values = np.array([v for body in bodies(*_symbols(robot))[0] for v in body.parameters])
    return lambda *motion: regressor_of(*motion) @ values


def regressor(robot):
    """Return a function of the motion that gives D (n, N), with D P the actuator forces.

    Parameters come in the paper's order: sliders, upper links and cranks, lower links, platform.
    """
    function = _function(robot)

    def matrix(pose, velocity, acceleration):
        generalized, jacobian = function(pose, velocity, acceleration)
        return np.linalg.solve(np.array(jacobian).T, np.array(generalized))

    return matrix


def jacobian(robot):
    """Return a function of the pose that gives dq/dx (n, m)."""
    function, rest = _function(robot), np.zeros(describe(robot).freedom)
    return lambda pose: np.array(function(pose, rest, rest)[1])


def _symbols(robot):
    machine = describe(robot)
    return machine, ca.SX.sym("x", machine.freedom)


def _function(robot):
    """Return the function from (x, dx, ddx) to the forces along x per parameter, and dq/dx."""
    machine, x = _symbols(robot)
    dx, ddx = ca.SX.sym("dx", machine.freedom), ca.SX.sym("ddx", machine.freedom)
    gravity = ca.DM(machine.gravity)
    found, joints = bodies(machine, x)
    lagrangian, parameters = 0, []
    for body in found:
        parameter = ca.SX.sym("parameter", len(body.parameters))
        parameters.append(parameter)
        velocity = ca.jtimes(body.point, x, dx)
        kinetic = 0.5 * parameter[0] * ca.sumsqr(velocity)
        potential = -parameter[0] * ca.dot(gravity, body.point)
        for k, axis in enumerate(body.axes, start=1):
            kinetic += parameter[k] * ca.dot(velocity, ca.jtimes(axis, x, dx))
            potential -= parameter[k] * ca.dot(gravity, axis)
        for axis in body.axes[:1]:
            kinetic += 0.5 * parameter[-1] * ca.sumsqr(ca.jtimes(axis, x, dx))
        lagrangian += kinetic - potential
    momentum = ca.gradient(lagrangian, dx)
    generalized = (
        ca.jtimes(momentum, x, dx) + ca.jtimes(momentum, dx, ddx) - ca.gradient(lagrangian, x)
    )
    outputs = [
        ca.jacobian(generalized, ca.vertcat(*parameters)),
        ca.jacobian(ca.vertcat(*joints), x),
    ]
    return ca.Function("lagrange", [x, dx, ddx], outputs)


def bodies(machine, x):
    """Return the bodies in the paper's order, and the joint coordinates."""
    phi = x[3] if machine.turns else ca.SX(0)
    turn = ca.vertcat(
        ca.horzcat(ca.cos(phi), -ca.sin(phi), 0),
        ca.horzcat(ca.sin(phi), ca.cos(phi), 0),
        ca.DM([[0, 0, 1]]),
    )
    rotation = ca.mtimes(ca.DM(machine.frame), turn)
    joints, sliders, uppers, lowers = [], [], [], []
    for leg in machine.legs:
        a, b, d, e = (ca.DM(v) for v in (leg.first, leg.second, leg.d, leg.e))
        c = x[:3] + ca.mtimes(rotation, ca.DM(leg.s0))
        joint1 = ca.SX(ca.DM(leg.r))
        if not leg.crank:
            slide = ca.dot(d, c - joint1) / ca.dot(d, e)
            joint1 += slide * e
            joints.append(slide)
            sliders.append(Body((leg.slider_mass,), joint1, ()))
        w = c - joint1
        n2 = ca.dot(w, a) ** 2 + ca.dot(w, b) ** 2
        ll2 = leg.ll**2 - ca.dot(w, d) ** 2
        opening = ca.acos((n2 + leg.lu**2 - ll2) / (2 * ca.sqrt(n2) * leg.lu))
        angle = ca.atan2(ca.dot(w, b), ca.dot(w, a)) + leg.elbow * opening
        if leg.crank:
            joints.append(angle)
        upper = ca.cos(angle) * a + ca.sin(angle) * b
        lower = (w - leg.lu * upper) / leg.ll
        uppers.append(Body(leg.upper.moments, joint1, (upper, ca.cross(d, upper))))
        if leg.crank:
            m, mgx, _, inertia = leg.lower.moments
            lowers.append(Body((m, mgx, inertia), c, (lower,)))
        else:
            lowers.append(Body(leg.lower.moments, c, (lower, ca.cross(d, lower))))
    platform = Body(machine.platform.moments, x[:3], (rotation[:, 0], rotation[:, 1]))
    return [*sliders, *uppers, *lowers, platform], joints
