"""The motion of a machine whose joints stick: dry friction as a set of forces, all joints together.

A joint that slides has a friction of known size and sign. One that sticks has whatever friction its
rest asks for, within plus and minus the breakaway force. Which joints stick is an input here, the
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
from pteron.equations.drives import Drives, dry_friction, joint_motion
from pteron.equations.kinematics import jacobian
from pteron.equations.lagrangian import (
    applied,
    backward,
    factors,
    forward,
    mass_matrix,
    solve_positive_definite,
)
from pteron.equations.machine import Machine
from pteron.equations.transmissions import (
    Actuators,
    DriveKind,
    bristles,
    motor_force,
    transmitted,
    wanted_force,
)
from pteron.equations.virtual_work import generalized_forces

STUCK = {f"stuck_{name}": name for name in ("acceleration", "growth", "friction", "motor_growth")}
"""The names of what joints that stick change: with what holds them, and without."""


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


def moved(
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
    """Return what happens to a machine in a state, under what its drives are asked for.

    (M + J^T D J) x'' = J^T (F + tau - b q' - F_0 - D J' x') + wrench - h; tau is dry friction.
    Without `sides` there is none. Where a transmission bends, friction and D are the motor's, and
    the joint has what the transmission passes to it.

    Returns
    -------
    dict
        `acceleration` x'' (m, 1); `rates` (n, 1) of what friction acts on, joints or motors, with
        their `growth`; `friction`, and the `breakaway` that it cannot exceed; `motor_growth`,
        `change` and `yield`, the rates of `motor_rate`, `current` and `bristle`. These are as if
        joints that stick had no friction, which is all where none does; with `stuck_` before their
        names, `acceleration`, `growth`, `friction` and `motor_growth` are those with the friction
        that holds them.
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
    given, change, passed, yields = [], [], [], []
    most = dry_friction(drives, rates)
    coordinates = [leg.coordinate for leg in state.legs]
    for i in range(n):
        numbers = kind, motors.numbers, i
        force = wanted_force(*numbers, forces[i], rates[i])
        if kind.lag[i]:
            change.append((force - motors.current[i]) * motors.numbers("lag", i))
            force = motors.current[i]
        else:
            change.append(ca.SX(0))
        motor = motors.motor[i] if kind.elastic[i] else coordinates[i]
        rubs, growth = ca.SX(0), ca.SX(0)
        if kind.lugre[i]:
            slides = motors.bristle[i], rates[i], most[i], motors.pace
            rubs, growth = bristles(motors.numbers, i, *slides)
        yields.append(growth)
        given.append(motor_force(*numbers, force, motor) - rubs)
        bent = motors.motor[i] - coordinates[i], motors.motor_rate[i] - joint_rates[i]
        passed.append(transmitted(*numbers, *bent) if kind.elastic[i] else ca.SX(0))
    friction = breakaway = ca.SX.zeros(n)
    if sides is not None:
        breakaway = most * ca.SX([float(not one) for one in kind.lugre])
        friction = -sides.side * breakaway
    pull = ca.vertcat(*given) - drives.viscous * rates - drives.offset + friction
    inertia = rigid * drives.inertia
    load = rigid * (pull - drives.inertia * drift) + ca.vertcat(*passed)
    load = ca.mtimes(rows.T, load) + applied(machine, state, wrench)
    load -= generalized_forces(machine, state, parameters)
    mass = mass_matrix(machine, pose, parameters)
    mass += ca.mtimes(rows.T, ca.mtimes(ca.diag(inertia), rows))
    lower, pivots = factors(mass)
    acceleration = backward(lower, forward(lower, load) / pivots)
    growth = rigid * (ca.mtimes(rows, acceleration) + drift) + ca.vertcat(
        *(
            (pull[i] - passed[i]) / drives.inertia[i] if kind.elastic[i] else ca.SX(0)
            for i in range(n)
        )
    )
    found = {"acceleration": acceleration, "rates": rates, "growth": growth}
    found |= {"friction": friction, "breakaway": breakaway}
    more = {"motor_growth": bends * growth, "change": ca.vertcat(*change)}
    more["yield"] = ca.vertcat(*yields)
    found |= {name: more[name] for _, name in kind.more if name in more}
    if sides is None:
        return found
    # What friction acts on: joints, which share the machine's mass, and motors by themselves.
    reach = forward(lower, ca.mtimes(ca.diag(rigid), rows).T)
    scaled = reach / ca.repmat(pivots, 1, n)
    own = [1 / drives.inertia[i] if kind.elastic[i] else ca.SX(0) for i in range(n)]
    mobility = ca.mtimes(reach.T, scaled) + ca.diag(ca.vertcat(*own))
    # Those that stick have the friction that their rest asks for, W tau = q'' - q''_alone.
    sticks = 1 - sides.side * sides.side
    asked = sides.hold - sides.brake * rates - growth
    matrix = mobility * ca.mtimes(sticks, sticks.T) + ca.diag(1 - sticks)
    holding = solve_positive_definite(matrix, sticks * asked)
    growth += ca.mtimes(mobility, holding)
    found["stuck_acceleration"] = acceleration + backward(lower, ca.mtimes(scaled, holding))
    found |= {"stuck_growth": growth, "stuck_friction": friction + holding}
    return found | ({"stuck_motor_growth": bends * growth} if any(kind.elastic) else {})
