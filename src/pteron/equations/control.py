"""One sample of a controller: its inputs, gains and memory, and the errors e = q_d - q of joints.

The desired motion is the platform's, the measured one the joints'. A control law is a pure
function: its memory is an output at one sample and an input at the next. The laws are in `laws`.

A controller holds its forces for a period while the machine moves on. So the model is evaluated in
the middle of the period: the desired motion is extrapolated by its Taylor series, with the change
of the desired acceleration since the last sample for the third derivative, and the measured joints
by the change of the desired ones. The errors are those at the sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.equations.closing import direct_step
from pteron.equations.drives import Drives, joint_motion
from pteron.equations.machine import Machine, State

Per = Literal["joint", "coordinate", "parameter", "pair", "law"]
"""The owner of each number in a part of a vector: a joint, a coordinate of the pose, a parameter
that is estimated, a pair of these, or the law as a whole."""

Layout = Mapping[str, Mapping[str, Per]]
"""The parts of a vector, in order, for each law by name."""

_FEEDBACK: dict[str, Per] = {"proportional": "joint", "derivative": "joint"}

_LEARNING: dict[str, Per] = {
    "slope": "joint",
    "derivative": "joint",
    "period": "law",
    "start": "parameter",
    "learning": "pair",
    "room": "law",
}

GAINS: Layout = {
    "pd_gravity": _FEEDBACK,
    "feed_forward_pd": {**_FEEDBACK, "period": "law"},
    "computed_torque": {**_FEEDBACK, "period": "law"},
    "adaptive": _LEARNING,
    "adaptive_drives": _LEARNING,
}
"""The parts of each law's gains, in order."""

_LEARNT: dict[str, Per] = {
    "measured": "coordinate",
    "acceleration": "coordinate",
    "learnt": "parameter",
}

MEMORY: Layout = {
    "pd_gravity": {"measured": "coordinate"},
    "feed_forward_pd": {"acceleration": "coordinate"},
    "computed_torque": {"measured": "coordinate", "acceleration": "coordinate"},
    "adaptive": _LEARNT,
    "adaptive_drives": _LEARNT,
}
"""The parts of each law's memory, in order: the last measured pose, the last desired acceleration,
and the correction eta of the initial estimates, see `estimates`."""

ADAPTED = ("inertia", "coulomb", "viscous", "offset")
"""Drives' numbers that `adaptive_drives` estimates after the inertial or base parameters, each for
all joints: the first of `Drives`, in which forces are linear."""


def lengths(parts: Mapping[str, Per], freedom: int, joints: int, estimates: int) -> dict[str, int]:
    """Return the length of each named part of a controller's gains or memory vector."""
    sizes = {
        "joint": joints,
        "coordinate": freedom,
        "parameter": estimates,
        "pair": estimates**2,
        "law": 1,
    }
    return {name: sizes[per] for name, per in parts.items()}


def estimate_count(what: str, joints: int, inertial: int) -> int:
    """Return the number of parameters that the law `what` estimates."""
    return inertial + (len(ADAPTED) * joints if what == "adaptive_drives" else 0)


def input_sizes(what: str, freedom: int, joints: int, inertial: int) -> dict[str, int]:
    """Return the lengths of a law's "gains" and "memory"; {} if `what` is no law."""
    estimates = estimate_count(what, joints, inertial)
    return {
        name: sum(lengths(parts[what], freedom, joints, estimates).values())
        for name, parts in (("gains", GAINS), ("memory", MEMORY))
        if what in parts
    }


def split_parts(vector: Expression, sizes: Mapping[str, int]) -> dict[str, Expression]:
    """Return the parts of a vector (K, 1) by name, with lengths `sizes` in this order."""
    bounds = [0]
    for size in sizes.values():
        bounds.append(bounds[-1] + size)
    return dict(zip(sizes, ca.vertsplit(vector, bounds), strict=True))


def estimates(gains: Mapping[str, Expression], learnt: Expression) -> Expression:
    """Return the estimated parameters theta_0 + L eta (K, 1) for the learnt eta (K, 1)."""
    count = learnt.shape[0]
    return gains["start"] + ca.mtimes(ca.reshape(gains["learning"], count, count), learnt)


class DesiredMotion(NamedTuple):
    """The platform's desired motion at a sample: pose, velocity, acceleration, (m, 1) each."""

    pose: Expression
    velocity: Expression
    acceleration: Expression

    def middle(self, period: Expression, last: Expression) -> DesiredMotion:
        """Return the desired motion half a period later, extrapolated with its jerk."""
        t, third = period / 2, (self.acceleration - last) / period
        return DesiredMotion(
            self.pose + t * (self.velocity + t / 2 * (self.acceleration + t / 3 * third)),
            self.velocity + t * (self.acceleration + t / 2 * third),
            self.acceleration + t * third,
        )


@dataclass(frozen=True)
class Sample:
    """The inputs of a law."""

    machine: Machine
    desired: DesiredMotion
    joints: Expression
    """Measured, (n, 1)."""
    rates: Expression
    gains: Mapping[str, Expression]
    memory: Mapping[str, Expression]
    drives: Drives
    parameters: Expression
    """(N, 1), where the law takes them as they are."""
    selection: Expression
    """(N, K): inertial parameters = selection @ the estimates of them."""
    least: float
    """The type-II measure below which a measured pose is invalid."""

    @cached_property
    def now(self) -> State:
        """The machine's state of the desired motion at the sample."""
        return self.machine.state(*self.desired)

    @cached_property
    def middle(self) -> State:
        """The machine's state of the desired motion half a period after the sample."""
        ahead = self.desired.middle(self.gains["period"], self.memory["acceleration"])
        return self.machine.state(*ahead)

    @cached_property
    def error(self) -> Expression:
        """The joints' position errors e (n, 1), m or rad; a crank's is wrapped to [-pi, pi]."""
        behind = ca.vertsplit(coordinates(self.now) - self.joints)
        legs = self.machine.robot.legs
        return ca.vertcat(
            *(
                ca.atan2(ca.sin(e), ca.cos(e)) if leg.goes_round else e
                for leg, e in zip(legs, behind, strict=True)
            )
        )

    @cached_property
    def error_rate(self) -> Expression:
        """The joints' rate errors e' (n, 1), m/s or rad/s."""
        return joint_motion(self.now)[0] - self.rates

    @property
    def feedback(self) -> Expression:
        """The feedback force K_p e + K_d e' (n, 1), N or N m."""
        return self.gains["proportional"] * self.error + self.gains["derivative"] * self.error_rate

    @cached_property
    def middle_rates(self) -> Expression:
        """The measured joint rates (n, 1), extrapolated half a period ahead."""
        return joint_motion(self.middle)[0] - self.error_rate

    def find_pose(self, joints: Expression) -> Expression:
        """Return the pose (m, 1) of joints (n, 1), by Newton's method from the last pose."""
        return direct_step(self.machine, joints, self.memory["measured"], self.least)[0]

    @cached_property
    def middle_pose(self) -> Expression:
        """The measured pose (m, 1), extrapolated half a period ahead."""
        joint_motion_to_middle = coordinates(self.middle) - coordinates(self.now)
        return self.find_pose(self.joints + joint_motion_to_middle)


def coordinates(state: State) -> Expression:
    """Return the coordinates (n, 1) of the actuated joints, m or rad."""
    return ca.vertcat(*(leg.coordinate for leg in state.legs))
