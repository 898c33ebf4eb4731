"""An independent derivation: Lagrange's equations by differentiation of energies.

Nothing of `pteron.equations` is used: positions come from trigonometry (law of cosines, atan2)
instead of the circle lemma, velocities and everything after from automatic differentiation. A body
turns with the direction of its x axis: a link's in its plane, a rod's without a spin of its own.
"""

from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from descriptions import carried, describe, places, position, turned


class Body(NamedTuple):
    """Its parameters, its reference point, and its axes.

    A slider has m and no axis, a rod m, mgx, I and x, a link m, mgx, mgy, I and x, y; a body that
    turns about any axis has m, three moments and its tensor, row by row, and three axes.
    """

    parameters: tuple
    point: Any
    axes: tuple


class Lagrange:
    """The dynamics of a machine, for batches of states (B, m)."""

    def __init__(self, robot):
        machine = describe(robot)
        x, dx, ddx = (ca.SX.sym(name, machine.freedom) for name in ("x", "dx", "ddx"))
        joints, found, parts = bodies(machine, x)
        self.parameters = np.array([value for body in found for value in body.parameters])
        """In the paper's order: sliders, upper links and cranks, lower links, platform."""
        found += parts
        self._all_parameters = np.array([value for body in found for value in body.parameters])
        symbols = [ca.SX.sym("parameters", len(body.parameters)) for body in found]
        energies = [
            _energies(body, parameters, x, dx, ca.DM(machine.gravity))
            for body, parameters in zip(found, symbols, strict=True)
        ]
        kinetic, potential = map(sum, zip(*energies, strict=True))
        momentum = ca.gradient(kinetic, dx)
        generalized = (
            ca.jtimes(momentum, x, dx)
            + ca.jtimes(momentum, dx, ddx)
            - ca.gradient(kinetic - potential, x)
        )
        parameters = ca.vertcat(*symbols)
        regressor = ca.jacobian(generalized, parameters)
        jacobian = ca.jacobian(ca.vertcat(*joints), x)
        self._forces = ca.Function("forces", [x, dx, ddx], [regressor, jacobian])
        self._energies = ca.Function("energies", [parameters, x, dx], [kinetic, potential])

    def regressor(self, *motion):
        """Return D (B, n, N), with D P the actuator forces of a platform without parts."""
        return self._whole_regressor(motion)[..., : len(self.parameters)]

    def forces(self, *motion):
        """Return the actuator forces (B, n)."""
        return self._whole_regressor(motion) @ self._all_parameters

    def _whole_regressor(self, motion):
        generalized, jacobian = (_batch(v, motion) for v in self._forces(*_columns(motion)))
        if jacobian.shape[1] > jacobian.shape[2]:  # more legs than coordinates: of least norm
            return np.linalg.pinv(jacobian.swapaxes(1, 2)) @ generalized
        return np.linalg.solve(jacobian.swapaxes(1, 2), generalized)

    def jacobian(self, pose):
        """Return dq/dx (B, n, m)."""
        motion = pose, np.zeros_like(pose), np.zeros_like(pose)
        return _batch(self._forces(*_columns(motion))[1], motion)

    def energies(self, *motion):
        """Return kinetic and potential energy, (B,) each."""
        found = self._energies(self._all_parameters, *_columns(motion))
        return tuple(np.array(value).ravel() for value in found)


def _columns(motion):
    return [np.transpose(value) for value in motion]


def _batch(value, motion):
    """Return (B, rows, columns) from the batch's matrices beside each other."""
    value, count = np.array(value), len(motion[0])
    return value.reshape(len(value), count, -1).swapaxes(0, 1)


def _energies(body, parameters, x, dx, gravity):
    """Return the kinetic and the potential energy of a body with symbols for its parameters."""
    velocity = ca.jtimes(body.point, x, dx)
    kinetic = 0.5 * parameters[0] * ca.sumsqr(velocity)
    potential = -parameters[0] * ca.dot(gravity, body.point)
    for k, axis in enumerate(body.axes, start=1):
        kinetic += parameters[k] * ca.dot(velocity, ca.jtimes(axis, x, dx))
        potential -= parameters[k] * ca.dot(gravity, axis)
    rates = [ca.jtimes(axis, x, dx) for axis in body.axes]
    if len(rates) == 3:
        tensor = ca.reshape(parameters[4:], 3, 3)
        second = 0.5 * ca.trace(tensor) * ca.SX.eye(3) - tensor  # the integral of r r^T dm
        return kinetic + 0.5 * ca.trace(
            second @ ca.horzcat(*rates).T @ ca.horzcat(*rates)
        ), potential
    for rate in rates[:1]:
        kinetic += 0.5 * parameters[-1] * ca.sumsqr(rate)
    return kinetic, potential


def bodies(machine, x):
    """Return the joint coordinates, the bodies in the paper's order, and the platform's parts."""
    joints, sliders, uppers, pistons, lowers = [], [], [], [], []
    for leg, at in zip(machine.legs, places(machine, x), strict=True):
        joints.append(at.joint)
        fixed = ca.SX(ca.DM(leg.r))
        if leg.e is not None:
            fixed += at.slide * ca.DM(leg.e)
            sliders.append(Body((leg.slider_mass,), fixed, ()))
        direction = at.last / ca.norm_2(at.last)
        if leg.ratio is not None:
            uppers.append(_rod(leg.upper, fixed, direction))
        elif leg.swings:
            uppers.append(_rod(leg.upper, fixed, at.upper))
        elif leg.upper is not None:
            uppers.append(
                _link(leg.upper, fixed, at.upper, leg.d if at.turn is None else at.turn[0])
            )
        if leg.piston is not None:
            pistons.append(_link(leg.piston, at.point - at.last, at.upper, at.turn[0]))
        if at.turn is not None:
            axes = direction, at.turn[1], ca.cross(direction, at.turn[1])
            lowers.append(Body(leg.lower.moments, at.point, axes))
        elif leg.flat:
            lowers.append(_link(leg.lower, at.point, direction, leg.d))
        else:
            lowers.append(_rod(leg.lower, at.point, direction))
    p, turn = position(machine, x), carried(machine, x)
    axes = ca.horzsplit(turn)
    platform = Body(machine.platform.moments, p, tuple(axes if machine.tilts else axes[:2]))
    bars = [Body((mass,), p + ca.mtimes(turn, ca.DM(hinge)), ()) for mass, hinge in machine.bars]
    geared = [
        Body((0.0, 0.0, inertia), p, (turned(machine, ratio * x[-1])[:, 0],))
        for inertia, ratio in machine.geared
    ]
    return joints, [*sliders, *uppers, *pistons, *lowers, platform], [*bars, *geared]


def _link(body, point, x, d):
    return Body(body.moments, point, (x, ca.cross(ca.DM(d), x)))


def _rod(body, point, x):
    m, mgx, _, inertia = body.moments
    return Body((m, mgx, inertia), point, (x,))
