"""`tune`: the greatest bandwidth of a controller with stated margins, at all poses of interest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pteron.arguments import expect
from pteron.controllers import Controller, FeedForwardPD
from pteron.controllers.feedback import Feedback
from pteron.controllers.joint_masses import light_poses
from pteron.errors import DataError, shorten
from pteron.kernels import Array
from pteron.kinematics import inverse_kinematics
from pteron.kinematics.evaluate import finite_rows
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.motion.motion import Motion, pose_text
from pteron.motion.payload import with_payload
from pteron.motion.simulation import Sensors
from pteron.motion.simulation.sensors import rate_shares
from pteron.motion.tuning.linear_law import linearised_law
from pteron.motion.tuning.linear_plant import linearise
from pteron.motion.tuning.margins import LoopMargins
from pteron.motion.tuning.sampled_loop import SampledLoop
from pteron.progress import Progress, Steps
from pteron.result import Result
from pteron.workspace.margins import joint_distances

if TYPE_CHECKING:
    import polars as pl

_MOMENTS = 16
"""Moments of a motion at which the loop is linearised."""

_PLACES = 24
"""Random poses at which it is."""

_DAMPINGS = 1.0, 1.4, 2.0, 2.8, 4.0, 5.6
"""Factors on the damping that are tried one after the other until a bandwidth serves: a joint that
is nine times as heavy as its gains suppose has a third of the damping, at any bandwidth."""

_STEPS = {"Linearising": 1.0, "Searching": 1.0}
"""The steps of tuning, and how their times compare."""

_USUAL_TRIALS = 20
"""Bandwidths that a search tries as a rule; their number is not known before."""

_FINER, _EXACT = 0.8, 1e-4
"""Factor between bandwidths tried from above, and relative length of the last bisection."""

_SLOWEST = 1e-3
"""The least bandwidth tried, as a share of the greatest."""


@dataclass(frozen=True)
class Required:
    """The margins that a loop must have: gain, a factor, phase, rad, and delay, s.

    Gain and delay hold at each drive and at all at once. A delay of 0 asks for none.
    """

    gain: float = 2.0
    phase: float = np.pi / 4.0
    delay: float = 0.0

    def __post_init__(self) -> None:
        expect(1.0 < self.gain < np.inf, "gain margin", shorten(self.gain), "a factor above 1")
        if not 0.0 < self.phase < np.pi / 2.0:
            raise DataError(
                f"phase margin: {shorten(self.phase)} rad given, {np.degrees(self.phase):.4g} "
                "degrees; more than 0 and less than 90 degrees expected"
            )
        expect(0.0 <= self.delay < np.inf, "delay margin", shorten(self.delay), "0 s or more")

    def share(self, found: LoopMargins) -> float:
        """Return the least ratio of stability margin to required margin; 1 or more suffices."""
        each = self._share(found.gain.min(), found.delay.min()), found.phase.min() / self.phase
        if min(each) < 1.0:  # those of all drives at once take longer to compute
            return float(min(each))
        delay = found.common_delay if self.delay else 0.0
        return float(min(*each, self._share(found.common_gain, delay)))

    def _share(self, gain: float, delay: float) -> float:
        """Return the lesser of log(gain) / log(required gain) and delay / required delay."""
        factor = np.log(max(gain, 1.0)) / np.log(self.gain)
        return float(min(factor, delay / self.delay if self.delay else np.inf))


@dataclass(frozen=True, eq=False, repr=False)
class Tuning(Result):
    """A machine's controller with its stability margins at poses and moments of a motion.

    Attributes
    ----------
    robot : Manipulator
        The machine, with what it carries.
    controller : Controller
        With its gains.
    required : Required
        The margins asked for.
    states : array, shape (S, 3, m)
        Poses, velocities and accelerations at which the loop was linearised.
    moments : array, shape (S,)
        Their times in the motion, s; NaN of poses in the workspace, at rest.
    loops : tuple of SampledLoop
        The loops there.
    margins : tuple of Margins
        Theirs.
    """

    robot: Manipulator
    controller: Controller
    required: Required
    states: Array
    moments: Array
    loops: tuple[SampledLoop, ...]
    margins: tuple[LoopMargins, ...]

    @property
    def worst(self) -> int:
        """Index of the state where stability margin over required margin is least."""
        return int(np.argmin([self.required.share(margins) for margins in self.margins]))

    @property
    def least(self) -> dict[str, float]:
        """The least gain, phase (rad), delay (s) and disk margins of all states, by name."""
        each = [margins.least for margins in self.margins]
        return {name: min(least[name] for least in each) for name in each[0]}

    def gains(self) -> dict[str, list[float]]:
        """Return the proportional (or slope) and derivative gains of each joint, by name."""
        law = self.controller.law(self.robot)
        n = self.robot.joint_count
        first = "proportional" if isinstance(self.controller, Feedback) else "slope"
        return {first: law.gains[:n].tolist(), "derivative": law.gains[n : 2 * n].tolist()}

    def table(self) -> pl.DataFrame:
        """Return the stability margins as a table, a row for each state.

        The columns are t (of the motion; empty in the workspace), the pose, the gain, phase and
        delay margin of each drive, those of all drives together, the disk margin, and the decay
        rate of the slowest pole.
        """
        import polars as pl

        columns: dict[str, Any] = {"t": pl.Series(self.moments).fill_nan(None)}
        columns |= dict(zip(self.robot.coordinates, self.states[:, 0].T, strict=True))
        for name in ("gain", "phase", "delay", "crossover"):
            each = np.array([getattr(margins, name) for margins in self.margins]).T
            columns |= {f"{name}_{i}": column for i, column in enumerate(each, start=1)}
        for name in ("common_gain", "common_delay", "disk", "slowest"):
            columns[name] = [getattr(margins, name) for margins in self.margins]
        return pl.DataFrame(columns)


def tune(
    robot: RobotLike,
    motion: Motion | None = None,
    controller: Controller | None = None,
    *,
    required: Required | None = None,
    poses: Array | None = None,
    payload: float = 0.0,
    model: RobotLike | None = None,
    sensors: Sensors | None = None,
    delay: float = 0.0,
    progress: Progress | None = None,
) -> Tuning:
    """Return the controller of the greatest bandwidth that keeps the required stability margins.

    The loop of machine, drives, encoders, controller and delay is linearised at moments of the
    motion, and at poses of the workspace at rest, with all coupling of the closed chain. Its
    sampling is exact: forces are held from one sample to the next, and act after the delay.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    motion : Motion, optional
        What it is to do.
    controller : Controller, optional
        Its law, period and damping; by default `FeedForwardPD()`. One with a bandwidth or gains
        keeps them, and is refused where they have not the margins.
    required : Required, optional
        The margins; by default a gain of 2 and a phase of 45 degrees.
    poses : array, shape (P, m), optional
        Where else it is to have them; by default some at random, away from singularities and
        within the joints' limits.
    payload : float
        What it carries, kg, at the tool.
    model : Manipulator, name or path, optional
        What the controller takes it for; by default what it is, payload and all.
    sensors : Sensors, optional
        The encoders, whose rates lag; by default rates are exact.
    delay : float
        From a sample to the drives' force, s.
    progress : callable, optional
        Takes the share of the work that is done, a `Share` with the name of its step.

    Returns
    -------
    Tuning

    Raises
    ------
    DataError
        If a number is not sensible, a bandwidth is above half the sample
        rate, or no bandwidth has the margins.
    UnreachablePose, SingularPose
        If the machine cannot do the motion.

    Examples
    --------
    >>> from pteron.motion import tune
    >>> found = tune("five-bar")
    >>> found.least["gain"] >= 2.0
    True
    """
    robot, controller = as_manipulator(robot), controller or FeedForwardPD()
    expect(0.0 <= delay < np.inf, "delay", shorten(delay), "0 s or more")
    if payload:
        robot = with_payload(robot, payload)
    required, sensors = required or Required(), sensors or Sensors()
    late = delay + sensors.delay + sensors.samples * controller.period
    states, moments = _states(robot, motion, poses)
    steps = Steps(progress, _STEPS)
    plants = []
    for i, state in enumerate(states):
        steps.report("Linearising", i / len(states))
        plants.append(linearise(robot, *state))
    search = _Search(
        robot,
        as_manipulator(model) if model is not None else robot,
        controller,
        required,
        states,
        plants,
        {"delay": late, "share": rate_shares(sensors, robot, controller.period)},
        steps,
    )
    chosen = search.choose_controller()
    every = range(len(states))
    loops = tuple(search.loop(chosen, i) for i in every)
    margins = tuple(LoopMargins(loop) for loop in loops)
    steps.end()
    return Tuning(robot, chosen, required, states, moments, loops, margins)


def _states(robot: Manipulator, motion: Motion | None, poses: Array | None) -> tuple[Array, Array]:
    """Return states (S, 3, m) (pose and two derivatives) to linearise at; times (S,), s."""
    if poses is None:
        poses = light_poses(robot)
        within = (joint_distances(robot, inverse_kinematics(robot, poses)) >= 0.0).all(axis=-1)
        poses = poses[within][:_PLACES]
    poses = finite_rows(robot, poses, "poses").reshape(-1, robot.freedom)
    zero_rates = np.zeros_like(poses)
    states, times = np.stack([poses, zero_rates, zero_rates], axis=1), np.full(len(poses), np.nan)
    if motion is not None:
        motion.expect_ascending()
        moments = np.linspace(motion.time[0], motion.time[-1], _MOMENTS)
        states = np.concatenate([np.stack(motion.at(moments), axis=1), states])
        times = np.concatenate([moments, times])
    if not len(states):
        raise DataError("poses: none given, and no motion; give one of them")
    return states, times


@dataclass(frozen=True)
class _Search:
    robot: Manipulator
    model: Manipulator
    controller: Controller
    required: Required
    states: Array
    plants: Sequence[Any]
    how: dict[str, Any]
    steps: Steps

    def loop(self, controller: Controller, i: int) -> SampledLoop:
        """Return the linearised sampled loop of a controller at state number i."""
        law = linearised_law(controller.law(self.model), *self.states[i])
        return SampledLoop(self.plants[i], law, controller.period, **self.how)

    def share(self, controller: Controller, which: Sequence[int]) -> tuple[float, int]:
        """Return the least ratio margin / required margin of some states, and that state."""
        return min((self.required.share(LoopMargins(self.loop(controller, i))), i) for i in which)

    def choose_controller(self) -> Controller:
        """Return the controller of greatest bandwidth with sufficient margins; raise if none."""
        controller, every = self.controller, range(len(self.states))
        most = np.pi / controller.period
        has_gains = (
            controller.bandwidth is not None
            or getattr(controller, "proportional", None) is not None
        )
        if controller.bandwidth is not None and np.max(controller.bandwidth) >= most:
            raise DataError(
                f"bandwidth: {np.max(controller.bandwidth):g} rad/s given, below {most:.4g} rad/s "
                f"expected: half the sample rate of {1.0 / controller.period:g} Hz"
            )
        if has_gains:
            share, at = self.share(controller, every)
            if share < 1.0:
                raise DataError(
                    f"{self._margins_text(controller, at)}; lower the gains, or ask for less"
                )
            return controller
        tried: list[tuple[float, Controller]] = []
        few = [0]
        for factor in _DAMPINGS if isinstance(controller, Feedback) else (1.0,):
            trial = controller
            if isinstance(controller, Feedback) and factor > 1.0:
                trial = replace(controller, damping=float(factor * np.max(controller.damping)))
            greatest = self._greatest(trial, most * (1.0 - 1e-9), few, tried)
            if greatest is not None:
                return greatest
        best = max(tried, key=lambda trial_share: trial_share[0])[1]
        _, at = self.share(best, every)
        raise DataError(
            f"no bandwidth has the required margins; the best: {self._margins_text(best, at)}; "
            "require less, sample faster, or shorten the delay"
        )

    def _greatest(
        self,
        controller: Controller,
        high: float,
        few: list[int],
        tried: list[tuple[float, Controller]],
    ) -> Controller | None:
        """Return the controller of greatest bandwidth with sufficient margins, or None if none has.

        `few` are the states that limited the bandwidth so far, `tried` the controllers tried, with
        their least ratio.
        """

        def share(bandwidth: float) -> float:
            """Return the least ratio margin / required margin at a bandwidth, rad/s."""
            attempt = replace(controller, bandwidth=bandwidth)
            tried.append((self.share(attempt, few)[0], attempt))
            self.steps.report("Searching", len(tried) / (len(tried) + _USUAL_TRIALS))
            return tried[-1][0]

        while True:  # bisect at few states; add the one that serves least at what is found
            low = high
            while share(low) < 1.0:
                high, low = low, low * _FINER
                if low < _SLOWEST * np.pi / controller.period:
                    return None
            while high - low > _EXACT * low:
                middle = float(np.sqrt(low * high))
                low, high = (middle, high) if share(middle) >= 1.0 else (low, middle)
            best = replace(controller, bandwidth=low)
            least, at = self.share(best, range(len(self.states)))
            if least >= 1.0:
                return best
            few.append(at)
            high = low

    def _margins_text(self, controller: Controller, i: int) -> str:
        """Return the text of a controller's margins at state i beside the required margins."""
        least, required = LoopMargins(self.loop(controller, i)).least, self.required
        delay_text = f", {1e3 * required.delay:.3g} ms" if required.delay else ""
        rate = controller.bandwidth
        with_ = f"with {np.max(rate):.4g} rad/s" if rate is not None else "with these gains"
        return (
            f"{with_}, at pose {pose_text(self.states[i][0])} the gain margin is "
            f"{least['gain']:.3g}, the phase margin {np.degrees(least['phase']):.3g} degrees, the "
            f"delay margin {1e3 * least['delay']:.3g} ms; required are "
            f"{required.gain:.3g} and {np.degrees(required.phase):.3g} degrees{delay_text}"
        )
