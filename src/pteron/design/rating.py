"""`Rating`: the figures of a machine for a job, and the bounds that it misses."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pteron.design.structure import Joint, Structure
from pteron.kernels import Array
from pteron.manipulator import Manipulator
from pteron.parts.drives import Option
from pteron.parts.joints import JointPart

_TIE = 2e-3
"""Weight of the logarithm of a machine's volume beside that of the objective."""

_BY_STAGE = 100.0
"""Cost of a design that fails at the last stage; of one before it is twice as much, and so on."""


@dataclass
class Rating:
    """The figures of a machine and its violated bounds, up to the stage at which it failed.

    Attributes
    ----------
    values : array, shape (V,)
        The numbers of the kind.
    figures : dict
        Quantities by name: objectives, margins, error, deflection.
    misses : dict
        By how much each bound is missed, as a share of it: empty where all is kept.
    shortfalls : dict
        The same in words.
    robot : Manipulator or None
        The machine with its drives, without payload.
    middle : array, shape (m,)
        The pose in the middle of the workspace.
    options : tuple of Option
        The drive of each leg.
    worst : array, shape (C, m)
        Poses from the middle at which measures of singularity are least.
    stage : int
        At which it fell out; 0 where it did not.
    near : float
        How far the next cheaper drives are from serving, from 0 on.
    structure : Structure or None
        The loads on links and joints at the corners of the workspace.
    joints, parts : list of list
        The joints of each leg, and the part chosen for each.
    drives_box : array, shape (2, 3), or None
        Least and greatest coordinates of motors, gears and rails, m.
    """

    values: Array
    figures: dict[str, float] = field(default_factory=dict)
    misses: dict[str, float] = field(default_factory=dict)
    shortfalls: dict[str, str] = field(default_factory=dict)
    robot: Manipulator | None = None
    middle: Array = field(default_factory=lambda: np.zeros(0))
    options: tuple[Option, ...] = ()
    worst: Array = field(default_factory=lambda: np.zeros((0, 0)))
    stage: int = 0
    near: float = 1.0
    structure: Structure | None = None
    joints: list[list[Joint]] = field(default_factory=list)
    parts: list[list[JointPart]] = field(default_factory=list)
    drives_box: Array | None = None

    @property
    def machine(self) -> Manipulator:
        """The machine of the rated design; only defined if the first stage of rating passed."""
        assert self.robot is not None
        return self.robot

    def miss(self, name: str, share: float, words: str) -> None:
        """Record the violation of limit `name` as a share of the limit, with a text."""
        if share > self.misses.get(name, 0.0):
            self.misses[name], self.shortfalls[name] = float(share), words

    def expect(self, name: str, figure: float, bound: float, at_least: bool) -> None:
        """Record a violation if `figure` is below a lower `bound`, or above an upper one."""
        share = bound / max(figure, 1e-12) if at_least else figure / bound
        if not share <= 1.0:
            words = "at least" if at_least else "at most"
            share = min(share - 1.0, 1e3) if np.isfinite(share) else 1e3
            self.miss(name, share, f"{name} {figure:.3g}, {words} {bound:.3g} permitted")

    def expect_least(self, name: str, figure: float, least: float) -> None:
        """Record a violation if `figure` is below `least`."""
        if not figure >= least:
            share = least - figure if np.isfinite(figure) else 1.0
            self.miss(name, share, f"{name} {figure:.3g}, at least {least:.3g} asked")

    def cost(self, objective: str) -> float:
        """Return the scalar cost of the design in a search: objective, or penalty of violations."""
        if self.misses:
            return _BY_STAGE * (7 - self.stage) + min(sum(self.misses.values()), 0.9 * _BY_STAGE)
        cost, figures = self.figures[objective], self.figures
        # Of equals the smaller machine is the better.
        size = _TIE * float(np.log(max(figures["footprint"] * figures["height"], 1e-9)))
        # A price has steps: along one the design is the better whose next step down is nearer.
        return float(np.log(max(cost, 1e-9)) + 0.01 * min(self.near, 1.0) + size)
