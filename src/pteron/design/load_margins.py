"""The margins of a design's drives at the worst places and in the worst directions of its job."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pteron.design.cycle_places import Places, neighbour_places
from pteron.design.joint_loads import duty_cycle_mean
from pteron.design.kind_evaluator import KindEvaluator
from pteron.design.limit_rows import DENSE, place_text
from pteron.design.workspace_samples import refine_worst_values
from pteron.design.worst_cases import worst_forces, worst_speeds
from pteron.dynamics import drive_forces
from pteron.kernels import Array
from pteron.kinematics import jacobian
from pteron.manipulator import Manipulator

_ROUNDS, _KEPT = 4, 3
"""Rounds of refinement of a cycle's places, and number of worst ones kept in each."""

_NOTHING = 1e-9
"""Lower bound of loads by which limits are divided, against 0/0."""


@dataclass
class LoadMargins:
    """Margins of drives: their limits over their loads.

    Attributes
    ----------
    figures : dict
        The least margin of rated torque, of peak torque and of speed, by name.
    least : float
        The least of them all.
    worst : str
        The motion and place of the least margin, in words.
    place : tuple of Places and int, or None
        The places of the cycle with the least margin, and the number of the worst one.
    """

    figures: dict[str, float] = field(default_factory=dict)
    least: float = np.inf
    worst: str = ""
    place: tuple[Places, int] | None = None

    def take(self, name: str, limits: Array, loads: Array) -> Array:
        """Return the least ratio limit / load (B,) over joints, and record the least as `name`."""
        margins = np.asarray((limits / np.maximum(loads, _NOTHING)).min(axis=-1))
        self.note(name, float(margins.min()))
        return margins

    def note(self, name: str, margin: float) -> None:
        """Record a margin (limit over load) if it is the least so far under this name."""
        self.figures[name] = min(self.figures.get(name, np.inf), margin)

    def note_place(
        self, margin: float, words: str, place: tuple[Places, int] | None = None
    ) -> None:
        """Record the motion and place of a margin if it is the least so far of all names."""
        if margin < self.least:
            self.least, self.worst, self.place = margin, words, place or self.place


def margins_of(
    evaluator: KindEvaluator,
    robot: Manipulator,
    middle: Array,
    time: float | None,
    process: Array | float = 0.0,
) -> LoadMargins:
    """Return the drives' margins (limit over load) for all cycles and motions of the job.

    Friction and rotor inertia are included, and the forces (n,) that the process adds; cycles that
    may be anywhere are evaluated at all their outermost places. `middle` (m,) is the pose in the
    middle of the workspace; `time`, s, is the duration of cycles without one.
    """
    drives = [leg.drive for leg in robot.legs if leg.drive is not None]
    most, rated, fastest = (
        np.array([getattr(drive, name) or np.inf for drive in drives])
        for name in ("max_force", "rated_force", "max_speed")
    )
    least_margins, squares, shares = LoadMargins(), [], evaluator.shares(time)
    for cycle in evaluator.every_cycle:
        duration = cycle.duration or time or 1.0
        places, greatest = cycle.both_ways(), np.zeros(robot.joint_count)
        for step in range(_ROUNDS + 1):
            states = evaluator.states(places, middle, duration)
            forces = drive_forces(robot, *states)
            rates = np.einsum("bkij,bkj->bki", jacobian(robot, states[0]), states[1])
            means = np.trapezoid(forces**2, axis=1) / (forces.shape[1] - 1) * duration
            means = (means + cycle.dwell * forces[:, -1] ** 2) / (duration + cycle.dwell)
            greatest = np.maximum(greatest, means.max(axis=0))
            every = [
                least_margins.take("peak_margin", most, np.abs(forces).max(axis=1) + process),
                least_margins.take("speed_margin", fastest, np.abs(rates).max(axis=1)),
            ]
            if not len(shares):
                every.append(least_margins.take("rated_margin", rated, np.sqrt(means) + process))
            k = int(np.min(every, axis=0).argmin())
            least_margins.note_place(float(np.min(every)), places.words(k), (places, k))
            worst = np.unique(np.argsort([*every, *-means.T], axis=1)[:, :_KEPT])
            places = neighbour_places(evaluator.job, places, worst, 0.5 ** (step + 1))
        squares.append(greatest)
    if len(shares):
        load = np.asarray(np.sqrt(duty_cycle_mean(np.array(squares), shares)) + process)
        least = float(least_margins.take("rated_margin", rated, load[None])[0])
        least_margins.note_place(least, "the rated torque of the whole duty cycle")
    required = evaluator.job.motion
    if required.acceleration or required.speed:
        speed = max(required.speed, _NOTHING)

        def motion_margins(places: Array) -> Array:
            """Return ratios (N, 2 n) of force and speed limits to the worst loads at N poses."""
            poses = middle + places
            forces = worst_forces(robot, poses, speed, required.acceleration) + process
            loads = np.hstack([forces, worst_speeds(robot, poses, speed)])
            return np.asarray(np.append(most, fastest) / np.maximum(loads, _NOTHING))

        margins, where = refine_worst_values(evaluator.job, robot, motion_margins, DENSE, keep=2)
        least_margins.note("peak_margin", float(margins[: len(most)].min()))
        least_margins.note("speed_margin", float(margins[len(most) :].min()))
        words = (
            f"the motion in any direction, at {place_text(robot, middle, where[margins.argmin()])}"
        )
        least_margins.note_place(float(margins.min()), words)
    return least_margins
