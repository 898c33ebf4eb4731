"""`optimal_excitation`: exciting trajectories, found by improving the best of random motions."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any, NamedTuple, get_args

import numpy as np

from pteron.arguments import expect, expect_one_of
from pteron.errors import DataError
from pteron.identification.excitation.conditioning import (
    Conditioning,
    condition_numbers,
    condition_with_penalty,
    information_root,
)
from pteron.identification.excitation.excitation import IDENTIFIES, Excitation, Start
from pteron.identification.excitation.fourier import FourierMotion, Space
from pteron.identification.excitation.improvement import ROUNDS, Improvement, Round, improve_starts
from pteron.identification.excitation.leads import found_lead
from pteron.identification.excitation.limits import Limits
from pteron.identification.excitation.margins import margins
from pteron.identification.excitation.random_motions import random_excitation
from pteron.identification.excitation.search_program import Criterion, Setting
from pteron.kernels import Array, columns_of
from pteron.manipulator import RobotLike, as_manipulator
from pteron.progress import Progress
from pteron.reduction import BaseParameters, base_parameters
from pteron.shapes import Seed, Workers, seed_number

_MOST_WORKERS = 4
"""Processes, at most, where their number is not given."""

_DRAWING = 0.3
"""The share of the time after which no more random motions are drawn."""

_FIRST = 0.6
"""The share of the time left that the first round may take."""

_ONE_OF = 2
"""One in so many starts, the best after the first round, goes on to the second."""

_SHORT = 0.2
"""Share of a column's length in random motions below which the column counts as short. By columns
scaled to length 1 alone a motion that all but rests in some direction would be as good as one that
moves: that of a Delta with a shaft went straight up and down, and left the shaft's values open."""

_FEWEST = 10
"""Least number of random motions, whatever the time: the best of one would be no choice."""

_LONGER = 3
"""Greatest duration of the search, over `seconds`, if its motion identifies too little."""

_SEEN = 0.1
"""Share of the progress bar that the random motions take."""


def optimal_excitation(
    robot: RobotLike,
    *,
    base: BaseParameters | None = None,
    space: Space = "platform",
    harmonics: int = 5,
    period: float = 5.0,
    limits: Limits | None = None,
    criterion: Criterion = "condition",
    starts: int = 12,
    draws: int = 100,
    seed: Seed = 0,
    seconds: float = 60.0,
    workers: Workers | None = None,
    progress: Progress | None = None,
) -> Excitation:
    """Return a periodic trajectory from whose forces the base parameters are seen best.

    The best of many random Fourier motions, each as large as the limits allow, are improved by
    sequential quadratic programming with exact gradients. The limits hold at samples; where they
    are then violated between these, the worst instants join the samples; in the end the motion is
    shrunk about its center, if need be, until all limits are kept throughout the period.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    base : BaseParameters, optional
        What is to be seen; `base_parameters(robot)` unless given.
    space : {"platform", "joints"}
        Whose coordinates the Fourier series are of.
    harmonics : int
        How many, 1 or more.
    period : float
        The time after which the motion repeats, s.
    limits : Limits, optional
        What the trajectory keeps at every instant; by default `Limits.of` the machine.
    criterion : {"condition", "logdet"}
        What is made small: the condition number of the base regressor with columns of length 1
        (see `scaled_condition`), times what it takes to lengthen columns that are short beside
        those of random motions; or the volume of the confidence ellipsoid, -log det.
    starts : int
        How many of the random motions, the best ones, are improved: all of them roughly, then the
        better half thoroughly.
    draws : int
        How many random motions there are.
    seed : int
        Where the random motions come from.
    seconds : float
        After which the best until then is returned; where that would not identify the machine, by
        a condition number above 1000, after three times as long. It holds for the search as a
        whole; what comes before, such as the base parameters, is not counted.
    workers : int, optional
        Processes that improve starts at the same time; 1 keeps to this one. By default as many as
        there are processors, four at most.
    progress : callable, optional
        Called with the share of the work that is done, from 0 to 1.

    Returns
    -------
    Excitation
        The trajectory, how good it is, the best random motion to compare with, its margins, and how
        it sets off from rest within the same limits.

    Raises
    ------
    ModelError
        If the machine does not even keep the limits at rest; the message names the limit.
    DataError
        If an argument is not what it should be, or the base parameters cannot be told apart by so
        few harmonics.
    SingularPose
        If the machine is singular at every pose.

    Notes
    -----
    The same arguments give the same result as long as the time does not cut the search short. An
    interrupt from the keyboard ends it, and returns the best until then, as soon as there is any.

    References
    ----------
    J. Swevers, C. Ganseman, D. B. Tukel, J. De Schutter, H. Van Brussel, Optimal robot excitation
    and identification, IEEE Trans. Robotics and Automation 13(5), 1997.

    Examples
    --------
    >>> import pteron
    >>> from pteron.identification.excitation import optimal_excitation
    >>> robot = pteron.load("tripteron")
    >>> found = optimal_excitation(robot, harmonics=2, starts=1, draws=5, workers=1)
    >>> found.margins.kept, found.gain > 2.0
    (True, True)
    """
    robot = as_manipulator(robot)
    limits = limits or Limits.of(robot)
    expect_one_of(get_args(Criterion), criterion=criterion)
    for name, count in (("starts", starts), ("draws", draws)):
        expect(count >= 1, name, count, "1 or more")
    expect(0.0 < seconds < math.inf, "seconds", seconds, "a number above 0")
    base = base or base_parameters(robot)
    motion: dict[str, Any] = {"space": space, "harmonics": harmonics, "period": period}
    motion["limits"] = limits
    seed = seed_number(seed)
    search = _Search(criterion, base, progress or (lambda share: None))
    interrupted = False
    begin = time.monotonic()
    try:
        for k, seeds in enumerate(np.random.SeedSequence(seed).spawn(draws)):
            rng = np.random.default_rng(seeds)
            search.drawn.append(search.judge_motion(random_excitation(robot, **motion, seed=rng)))
            search.report(_SEEN * (k + 1) / draws)
            late = time.monotonic() - begin > _DRAWING * seconds
            if late and len(search.drawn) >= _FEWEST:
                break
        search.short = _SHORT * search.lengths()
        search.setting = Setting(
            *(robot, columns_of(base), space, harmonics, period, limits, criterion),
            short=tuple(search.short),
        )
        processes = min(starts, workers or min(os.cpu_count() or 1, _MOST_WORKERS))
        search.choose(starts)
        for attempt in range(_LONGER):
            # At least half the time is for improvements, however long the drawing took.
            until = max(begin + (attempt + 1) * seconds, time.monotonic() + 0.5 * seconds)
            first, second = ROUNDS[criterion]
            remaining = until - time.monotonic()
            search.improve(search.starts, first, _FIRST * remaining, processes)
            best = sorted(search.starts, key=lambda start: search.cost(start.best))
            remaining = until - time.monotonic()
            search.improve(best[: math.ceil(starts / _ONE_OF)], second, remaining, processes)
            if search.identifies or all(start.finished for start in search.starts):
                break
    except KeyboardInterrupt:
        if not search.drawn:
            raise
        interrupted = True
    return search.result(limits, seed, time.monotonic() - begin, interrupted)


class _Candidate(NamedTuple):
    """A motion with its conditioning and the root (p, p) of its information matrix."""

    motion: FourierMotion
    conditioning: Conditioning
    root: Array


@dataclass
class _SearchStart:
    """A start of the search: a random motion by its number, and the best motion made from it."""

    draw: int
    first: _Candidate
    best: _Candidate
    finished: bool = False


@dataclass
class _Search:
    """The state of the search for an exciting motion."""

    criterion: Criterion
    base: BaseParameters
    progress: Progress
    short: Array = field(default_factory=lambda: np.zeros(1))
    """The lengths of columns (p,) below which a parameter is shown too little."""
    drawn: list[_Candidate] = field(default_factory=list)
    starts: list[_SearchStart] = field(default_factory=list)
    setting: Setting = field(init=False)
    share_done: float = 0.0
    """The share of the work that is done."""

    def judge_motion(self, motion: FourierMotion) -> _Candidate:
        """Return a motion with its conditioning and the root of its information matrix."""
        root = information_root(motion, self.base)
        return _Candidate(motion, condition_numbers(root, self.base.values(motion.robot)), root)

    def lengths(self) -> Array:
        """Return the columns' root mean square lengths (p,) over the random motions."""
        norms = np.array([np.linalg.norm(candidate.root, axis=0) for candidate in self.drawn])
        reached = norms[np.isfinite(norms).all(axis=1)]
        return np.sqrt((reached**2).mean(axis=0)) if len(reached) else np.zeros(self.base.rank)

    def cost(self, candidate: _Candidate) -> float:
        """Return a candidate's cost: -log det, or the condition number of columns long enough."""
        if self.criterion == "logdet":
            return -candidate.conditioning.logdet
        return condition_with_penalty(candidate.root, self.short)

    @property
    def identifies(self) -> bool:
        """Whether the best motion shows all base parameters."""
        best = min(self.starts, key=lambda start: self.cost(start.best)).best
        return best.conditioning.scaled <= IDENTIFIES

    def choose(self, starts: int) -> None:
        """Choose the best random motions as starts."""
        order = sorted(range(len(self.drawn)), key=lambda k: self.cost(self.drawn[k]))[:starts]
        self.starts = [_SearchStart(k, self.drawn[k], self.drawn[k]) for k in order]
        if not math.isfinite(self.cost(self.starts[0].best)):
            raise DataError(
                f"harmonics: {self.setting.harmonics} given, too few to tell {self.base.rank} "
                f"base parameters of {self.setting.robot.name} apart; take more"
            )

    def improve(
        self, starts: Sequence[_SearchStart], plan: Round, seconds: float, workers: int
    ) -> None:
        """Improve some starts in parallel, for `seconds` in all."""
        workers = min(workers, len(starts))
        each = seconds / math.ceil(len(starts) / workers)
        if each <= 0.0:
            return
        motions = enumerate(stage.best.motion for stage in starts)
        tasks = [Improvement(k, self.setting, plan, motion, each) for k, motion in motions]
        seen, share = self.share_done, [0.0] * len(starts)
        weight = (1.0 - seen) if plan.thorough else _FIRST * (1.0 - seen)
        with closing(improve_starts(tasks, workers)) as stages:
            for stage in stages:
                share[stage.number] = 1.0 if stage.ended else stage.done / (plan.stages + 1)
                start = starts[stage.number]
                start.finished = start.finished or (stage.finished and plan.thorough)
                if stage.feasible is not None:
                    start.best = min(start.best, self.judge_motion(stage.feasible), key=self.cost)
                self.report(seen + weight * sum(share) / len(share))

    def report(self, share: float) -> None:
        """Record the share of the work that is done, and report it."""
        self.share_done = share
        self.progress(share)

    def result(self, limits: Limits, seed: int, seconds: float, interrupted: bool) -> Excitation:
        """Return the best motion of all starts and random motions, with its margins."""
        random = min(self.drawn, key=self.cost)
        best = min([*(start.best for start in self.starts), random], key=self.cost)
        starts = tuple(
            Start(start.draw, start.first.conditioning, start.best.conditioning, start.finished)
            for start in self.starts
        )
        best_margins, lead = margins(best.motion, limits), found_lead(best.motion, limits)
        how = self.criterion, best.conditioning, random.conditioning, best_margins, lead, starts
        ended = len(self.drawn), seed, seconds, interrupted
        return Excitation(best.motion, limits, *how, *ended)
