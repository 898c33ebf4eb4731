"""Stick-slip motion: dry friction as a set-valued force, solved for all joints together.

A joint that slides has a friction of known size and sign. One that sticks has the friction that
keeps it at rest, within plus and minus the breakaway force. Which joints stick is an input, the
`side` of each: +1 or -1 where it slides that way, 0 where it sticks. With the joint rates after a
time h as unknowns, and A the mass matrix in joint coordinates, the right sides are those of the
least of (u - u*)^T A (u - u*) / 2 + h sum f_i |u_i|, u* being the rates without dry friction: there
every joint that slides does so against its friction, and no joint that sticks needs more than f_i.
A = W^-1, and W = J (M + J^T D J)^-1 J^T is what is computed, since it stays finite where J is
singular.
"""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.equations.drives import Drives, dry_friction, joint_motion, mass_with_rotors
from pteron.equations.kinematics import jacobian
from pteron.equations.lagrangian import (
    generalized_wrench,
    ldl_factors,
    solve_positive_definite,
    substitute_backward,
    substitute_forward,
)
from pteron.equations.machine import Machine
from pteron.equations.transmissions import (
    Actuators,
    DriveKind,
    bristles,
    limited_motor_force,
    motor_force,
    transmission_force,
)
from pteron.equations.virtual_work import generalized_forces

STUCK = {f"stuck_{name}": name for name in ("acceleration", "growth", "friction", "motor_growth")}
"""Outputs that sticking joints change, by the name of the one without the holding friction."""


_GIVE = 1e-9
"""Mobility of each joint by itself, relative to the machine's greatest, where legs are redundant:
what more than m joints that stick hold is then unique, and wrong by this share."""


class Sides(NamedTuple):
    """The joints that slide, and how fast those that stick come to rest."""

    side: Expression
    """+1 or -1 where a joint slides, 0 where it sticks (n, 1)."""
    hold: Expression
    """Acceleration of a joint that sticks (n, 1), and with it `- brake q'`."""
    brake: Expression
    """1 over the time in which a joint that sticks loses its rate, 1/s."""


class Motors(NamedTuple):
    """The drives of a machine that are more than forces at its joints, (n, 1) each."""

    kind: DriveKind
    numbers: Actuators
    motor: Expression
    """Coordinates of the motors at the joints, where transmissions bend."""
    motor_rate: Expression
    current: Expression
    """Forces of the currents at the joints, where they lag behind."""
    bristle: Expression
    """Deflections of the bristles of LuGre's friction."""
    pace: Expression
    """Greatest rate, 1/s, at which these follow."""


class _DriveOutputs(NamedTuple):
    """The drives' forces at motors and joints and their state rates, n scalars each."""

    motor_forces: list[Expression]
    """With ripple and cogging, less LuGre's friction."""
    transmission_forces: list[Expression]
    """The forces of elastic transmissions on their joints; 0 of a rigid one."""
    current_rates: list[Expression]
    bristle_rates: list[Expression]

    def state_rates(self, kind: DriveKind, motor_growth: Expression) -> dict[str, Expression]:
        """Return the rates of the drives' extra states, by name, except motor positions."""
        rates = {
            "motor_growth": motor_growth,
            "change": ca.vertcat(*self.current_rates),
            "yield": ca.vertcat(*self.bristle_rates),
        }
        return {name: rates[name] for _, name in kind.extra_states if name in rates}


def stick_slip_rates(
    machine: Machine,
    pose: Expression,
    velocity: Expression,
    forces: Expression,
    parameters: Expression,
    wrench: Expression,
    drives: Drives,
    motors: Motors,
    sides: Sides | None,
) -> dict[str, Expression]:
    """Return accelerations and drive states' rates by name, under commanded drive forces.

    (M + J^T D J) x'' = J^T (F + tau - b q' - F_0 - D J' x') + wrench - h; tau is dry friction, zero
    without `sides`. With an elastic transmission, friction and D are those of the motor, and the
    transmission's force acts on the joint.

    Returns
    -------
    dict
        `acceleration` x'' (m, 1); `rates` (n, 1) of what friction acts on, joints or motors, with
        their `growth`; `friction`, and the `breakaway` that it cannot exceed; `motor_growth`,
        `change` and `yield`, the rates of `motor_rate`, `current` and `bristle`. These hold with
        sliding friction alone. If `sides` are given, `acceleration`, `growth`, `friction` and
        `motor_growth` with `stuck_` before their names include the friction that holds the joints
        that stick.
    """
    state = machine.state(pose, velocity)
    rows = jacobian(state)
    joint_rates, drift = joint_motion(state)
    kind, n = motors.kind, rows.shape[0]
    bends = ca.SX(list(map(float, kind.elastic)))
    rigid = 1 - bends
    rates = ca.vertcat(
        *(motors.motor_rate[i] if kind.elastic[i] else joint_rates[i] for i in range(n))
    )
    sliding = dry_friction(drives, rates)
    coordinates = [leg.coordinate for leg in state.legs]
    outputs = _drive_outputs(motors, forces, rates, sliding, coordinates, joint_rates)
    friction = breakaway = ca.SX.zeros(n)
    if sides is not None:
        breakaway = sliding * ca.SX([float(not has_bristles) for has_bristles in kind.lugre])
        friction = -sides.side * breakaway
    pull = ca.vertcat(*outputs.motor_forces) - drives.viscous * rates - drives.offset + friction
    load = rigid * (pull - drives.inertia * drift) + ca.vertcat(*outputs.transmission_forces)
    load = ca.mtimes(rows.T, load) + generalized_wrench(machine, state, wrench)
    load -= generalized_forces(machine, state, parameters)
    mass = mass_with_rotors(machine, pose, parameters, rows, rigid * drives.inertia)
    lower, pivots = ldl_factors(mass)
    acceleration = substitute_backward(lower, substitute_forward(lower, load) / pivots)
    motor_growth = (
        (pull[i] - outputs.transmission_forces[i]) / drives.inertia[i]
        if kind.elastic[i]
        else ca.SX(0)
        for i in range(n)
    )
    growth = rigid * (ca.mtimes(rows, acceleration) + drift) + ca.vertcat(*motor_growth)
    motion = {"acceleration": acceleration, "rates": rates, "growth": growth}
    motion |= {"friction": friction, "breakaway": breakaway}
    motion |= outputs.state_rates(kind, bends * growth)
    if sides is None:
        return motion
    # Friction acts on joints, which share the machine's mass, and on motors by themselves.
    reach = substitute_forward(lower, ca.mtimes(ca.diag(rigid), rows).T)
    scaled = reach / ca.repmat(pivots, 1, n)
    motor_mobility = [1 / drives.inertia[i] if kind.elastic[i] else ca.SX(0) for i in range(n)]
    mobility = ca.mtimes(reach.T, scaled) + ca.diag(ca.vertcat(*motor_mobility))
    if n > machine.freedom:  # joints hold against each other: a slight give makes it unique
        mobility += _GIVE * ca.mmax(ca.diag(mobility)) * ca.SX.eye(n)
    holding = _holding_friction(mobility, sides, rates, growth)
    growth += ca.mtimes(mobility, holding)
    motion["stuck_acceleration"] = acceleration + substitute_backward(
        lower, ca.mtimes(scaled, holding)
    )
    motion |= {"stuck_growth": growth, "stuck_friction": friction + holding}
    return motion | ({"stuck_motor_growth": bends * growth} if any(kind.elastic) else {})


def _drive_outputs(
    motors: Motors,
    forces: Expression,
    rates: Expression,
    sliding: Expression,
    coordinates: list[Expression],
    joint_rates: Expression,
) -> _DriveOutputs:
    """Return each drive's motor and transmission forces and the rates of its extra states.

    `sliding` is the dry friction (n, 1), N or N m, that a joint has while it slides.
    """
    kind, outputs = motors.kind, _DriveOutputs([], [], [], [])
    for i in range(len(coordinates)):
        numbers = kind, motors.numbers, i
        force = limited_motor_force(*numbers, forces[i], rates[i])
        if kind.lag[i]:
            outputs.current_rates.append((force - motors.current[i]) * motors.numbers("lag", i))
            force = motors.current[i]
        else:
            outputs.current_rates.append(ca.SX(0))
        motor = motors.motor[i] if kind.elastic[i] else coordinates[i]
        bristle_friction, bristle_rate = ca.SX(0), ca.SX(0)
        if kind.lugre[i]:
            slip = motors.bristle[i], rates[i], sliding[i], motors.pace
            bristle_friction, bristle_rate = bristles(motors.numbers, i, *slip)
        outputs.bristle_rates.append(bristle_rate)
        outputs.motor_forces.append(motor_force(*numbers, force, motor) - bristle_friction)
        deflection = motors.motor[i] - coordinates[i], motors.motor_rate[i] - joint_rates[i]
        outputs.transmission_forces.append(
            transmission_force(*numbers, *deflection) if kind.elastic[i] else ca.SX(0)
        )
    return outputs


def _holding_friction(
    mobility: Expression, sides: Sides, rates: Expression, growth: Expression
) -> Expression:
    """Return the friction forces (n, 1), N or N m, that keep sticking joints at rest."""
    sticks = 1 - sides.side * sides.side
    needed_growth = sides.hold - sides.brake * rates - growth
    matrix = mobility * ca.mtimes(sticks, sticks.T) + ca.diag(1 - sticks)
    return solve_positive_definite(matrix, sticks * needed_growth)
