"""`choose`: which motors of a list can drive joints in a cycle, their ratios and margins."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # type: ignore[import-untyped]

from pteron.arguments import expect
from pteron.motion.sizing.drive_loads import HOLDING, Sizing, best_ratio, mean_squares
from pteron.motion.sizing.gearing import Span, peak_span, rated_span, speed_span, torques
from pteron.motion.sizing.motors import Motor
from pteron.result import Result
from pteron.tolerances import ROUNDING


@dataclass(frozen=True, eq=False, repr=False)
class MotorFit(Result):
    """A motor at a joint over a cycle: its feasible ratios, and its margins.

    Attributes
    ----------
    leg : int
        From 1.
    motor : Motor
        The motor.
    span : Span
        The ratios at which it keeps its rated torque, its peak torque and its speed, each with the
        margin asked for.
    ratio : float
        The one among them at which its root mean square torque is least, rad/m or rad/rad; where
        there is none, that of the ratios that its speed allows.
    rated_margin, peak_margin, speed_margin : float
        At that ratio, what the motor can do over what the cycle asks; from 1 on it is enough.
    inertia_ratio : float
        At that ratio, the greatest inertia of the load over the rotor's, both at the joint.
    """

    leg: int
    motor: Motor
    span: Span
    ratio: float
    rated_margin: float
    peak_margin: float
    speed_margin: float
    inertia_ratio: float

    @property
    def fits(self) -> bool:
        """Whether some gear ratio keeps all limits of the motor."""
        return bool(self.span)

    @property
    def margin(self) -> float:
        """The least margin (limit over load) of rated torque, peak torque and speed."""
        return min(self._margins.values())

    @property
    def scarcest(self) -> str:
        """The limit with the least margin: "rated torque", "peak torque" or "speed"."""
        margins = self._margins
        return min(margins, key=lambda name: margins[name])

    @property
    def _margins(self) -> dict[str, float]:
        """The motor's margins, limit over load, by the name of the limit."""
        return {
            "rated torque": self.rated_margin,
            "peak torque": self.peak_margin,
            "speed": self.speed_margin,
        }


@dataclass(frozen=True, eq=False, repr=False)
class CommonFit(Result):
    """A motor at several legs over a cycle, with an equal ratio at each.

    Attributes
    ----------
    legs : tuple of int
        From 1.
    motor : Motor
        The motor.
    span : Span
        The ratios at which it serves at all of them.
    ratio : float
        The one among them at which the largest of the legs' root mean square torques is least,
        rad/m or rad/rad.
    fits : tuple of MotorFit
        The motor at each leg, at this ratio.
    """

    ROWS = "fits"

    legs: tuple[int, ...]
    motor: Motor
    span: Span
    ratio: float
    fits: tuple[MotorFit, ...]

    @property
    def worst(self) -> MotorFit:
        """The fit at the leg where the motor's least margin is smallest."""
        return min(self.fits, key=lambda fit: fit.margin)


def choose(sizing: Sizing, motors: Sequence[Motor], *, margin: float = 1.0) -> tuple[MotorFit, ...]:
    """Return how each motor suits each joint: feasible motors first, by size, then others.

    A motor is feasible at a ratio if, times the margin, its root mean square torque over the cycle
    (rests included) is at most its rated torque, its greatest torque at most its peak torque, and
    its greatest speed at most its maximum speed. All feasible ratios are computed in closed form;
    losses of the transmission count as the joint's friction in the machine's file. Motors are
    ordered by rated torque times speed; infeasible motors follow, by their margin.

    Parameters
    ----------
    sizing : Sizing
        What the cycle asks of the joints; the motors of the machine's own file play no part.
    motors : sequence of Motor
        Those to choose from; `read_motors` reads them from a file.
    margin : float
        What a motor must be able to do, over what the cycle asks; 1 or more.

    Returns
    -------
    tuple of MotorFit
        One for each joint and motor, joint by joint.

    Raises
    ------
    DataError
        If the margin is not a number of 1 or more.

    Examples
    --------
    >>> import pteron
    >>> from pteron.motion import Motor, choose, pick_and_place, size
    >>> robot = pteron.load("tripteron")
    >>> found = size(robot, pick_and_place(robot, [0.0, 0.0, 0.0], scale=0.5, duration=0.5))
    >>> fit = choose(found, [Motor("200 W", 3e-5, 0.64, 1.9, 600.0)])[0]
    >>> fit.fits, round(fit.ratio), round(fit.rated_margin, 1)
    (True, 295, 2.1)
    """
    alone = [(leg,) for leg in range(1, sizing.robot.joint_count + 1)]
    return tuple(fit.fits[0] for fit in rank_motors(sizing, alone, motors, margin))


def rank_motors(
    sizing: Sizing, groups: Sequence[tuple[int, ...]], motors: Sequence[Motor], margin: float
) -> list[CommonFit]:
    """Return how each motor suits each group of legs (one gear ratio per group), best first.

    In each group feasible motors come first, the smallest before others; then the infeasible ones,
    by margin.
    """
    expect(1.0 <= margin < math.inf, "margin", margin, "a number of 1 or more")
    fits: list[CommonFit] = []
    for legs in groups:
        fits += sorted((_fit(sizing, legs, motor, margin) for motor in motors), key=_order)
    return fits


def _order(fit: CommonFit) -> tuple[bool, float]:
    """Return a sort key: feasible motors first, by size; then infeasible ones, by margin."""
    size = fit.motor.rated_torque * fit.motor.max_speed
    return not fit.span, size if fit.span else -fit.worst.margin


def _fit(sizing: Sizing, legs: tuple[int, ...], motor: Motor, margin: float) -> CommonFit:
    """Return a motor's fit to a group of legs with a common gear ratio, feasible if possible."""
    span = fast = Span(0.0, math.inf)
    for leg in legs:
        fast = fast.intersect(speed_span(sizing, leg, motor.max_speed / margin))
        span = span.intersect(serving_span(sizing, leg, motor, margin))
    least, greatest = span if span else fast
    ratio = min(max(_best_ratio(sizing, legs, motor.rotor_inertia), least), greatest)
    if not math.isfinite(ratio):  # the joints only hold: any ratio from the least on serves
        ratio = least or 1.0
    fits = tuple(fit_at(sizing, leg, motor, span, ratio) for leg in legs)
    return CommonFit(legs, motor, span, ratio, fits)


def serving_span(sizing: Sizing, leg: int, motor: Motor, margin: float) -> Span:
    """Return the span of gear ratios at which a motor keeps its speed and torque limits."""
    rotor = motor.rotor_inertia
    span = speed_span(sizing, leg, motor.max_speed / margin)
    span = span.intersect(rated_span(sizing, leg, rotor, motor.rated_torque / margin))
    return span.intersect(peak_span(sizing, leg, rotor, motor.peak_torque / margin))


def _best_ratio(sizing: Sizing, legs: tuple[int, ...], rotor_inertia: float) -> float:
    """Return the gear ratio that minimises the largest rms torque over several legs."""
    optimal_ratios = [best_ratio(sizing, leg, rotor_inertia) for leg in legs]
    moving = [ratio for ratio in optimal_ratios if math.isfinite(ratio)]
    if not moving:
        return math.inf
    least, most = min(moving), max(moving)
    if len(moving) < len(optimal_ratios):  # where a leg only holds, more is better
        most *= HOLDING
    if most - least <= ROUNDING * most:
        return most

    def largest(log: float) -> float:
        """Return the largest mean square torque over the legs, (N m)^2, at a ratio's logarithm."""
        ratio = math.exp(log)
        return max(float(mean_squares(sizing, leg, ratio, rotor_inertia).max()) for leg in legs)

    # The largest of convex functions of i^2, which all fall before these bounds and rise behind.
    bounds = math.log(least), math.log(most)
    solution = scipy.optimize.minimize_scalar(
        largest, bounds=bounds, method="bounded", options={"xatol": ROUNDING}
    )
    return math.exp(solution.x)


def fit_at(sizing: Sizing, leg: int, motor: Motor, span: Span, ratio: float) -> MotorFit:
    """Return a motor's margins (limit over load) at a leg for a gear ratio."""
    rotor = motor.rotor_inertia
    rms, peak = torques(sizing, leg, ratio, rotor)
    load_inertia = float(sizing.load_inertia[1, leg - 1])
    return MotorFit(
        leg,
        motor,
        span,
        ratio,
        _margin(motor.rated_torque, rms),
        _margin(motor.peak_torque, peak),
        _margin(motor.max_speed, ratio * float(sizing.peak_speeds[leg - 1])),
        _margin(load_inertia, ratio**2 * rotor),
    )


def _margin(limit: float, needed: float) -> float:
    """Return limit / needed; infinity if `needed` is zero."""
    return limit / needed if needed > 0.0 else np.inf
