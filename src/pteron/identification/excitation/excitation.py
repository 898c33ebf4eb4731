"""An exciting trajectory: the motion, its conditioning, its margins to all limits, its files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from pteron.equations.machine import closure_of
from pteron.identification.excitation.conditioning import Conditioning
from pteron.identification.excitation.fourier import FourierMotion
from pteron.identification.excitation.held_out import RepeatedCycle, held_out_cycle
from pteron.identification.excitation.layout import MotionLayout, check_sampling
from pteron.identification.excitation.leads import Lead, LedMotion
from pteron.identification.excitation.limits import Limits
from pteron.identification.excitation.margins import Margins
from pteron.identification.excitation.motion_files import motion_paths, write_motions
from pteron.identification.excitation.movement import Movement
from pteron.identification.excitation.search_program import Criterion
from pteron.identification.logs import Description, write_description
from pteron.json_values import json_fields
from pteron.kinematics import assembly_mode
from pteron.manipulator.machine_record import machine_record
from pteron.result import Result
from pteron.tables import write_table

_SLOWER = 5.0
"""Factor by which slow passages are slower than the trajectory, where they are fastest."""


IDENTIFIES = 1000.0
"""Condition number above which a motion does not identify the machine, and the search goes on: ten
times the 100 that K. Schroeer (1993) asks for; noise of 1 % then makes some values ten times as
uncertain as they are large."""


@dataclass(frozen=True)
class Start:
    """One start of the search: a random motion, and the best that was made of it.

    Attributes
    ----------
    draw : int
        Number of the random motion, counted from 0.
    before, after : Conditioning
        Conditioning of the random motion, and of the best that was made of it.
    finished : bool
        Whether it was improved thoroughly, rather than left for better ones or cut short.
    """

    draw: int
    before: Conditioning
    after: Conditioning
    finished: bool


@dataclass(frozen=True, eq=False, repr=False)
class Excitation(Result):
    """A trajectory that shows the base parameters well, and keeps the limits.

    Attributes
    ----------
    motion : FourierMotion
        The trajectory.
    limits : Limits
        What it keeps.
    criterion : {"condition", "logdet"}
        What was made small.
    conditioning : Conditioning
        How well it shows the base parameters.
    random : Conditioning
        How well the best of the random motions does, which keep the same limits.
    margins : Margins
        What it leaves of every limit.
    lead : Lead
        How it sets off from rest, and comes to rest, within the same limits.
    starts : tuple of Start
        The random motions that were improved, the best of them first.
    draws : int
        How many random motions there were.
    seed : int
        Where the random motions came from.
    seconds : float
        How long it took.
    interrupted : bool
        Whether it was ended from the keyboard, so that this is the best until then.
    """

    motion: FourierMotion
    limits: Limits
    criterion: Criterion
    conditioning: Conditioning
    random: Conditioning
    margins: Margins
    lead: Lead
    starts: tuple[Start, ...]
    draws: int
    seed: int
    seconds: float
    interrupted: bool

    @property
    def gain(self) -> float:
        """Scaled condition number of the best random motion over that of the trajectory."""
        return self.random.scaled / self.conditioning.scaled

    @property
    def progress_text(self) -> str:
        """How far the search came, and whether its motion identifies the machine, in sentences."""
        finished = sum(start.finished for start in self.starts)
        search = (
            f"Search: {self.draws} random motions drawn, the best {len(self.starts)} optimised in "
            f"{self.seconds:.0f} s, {finished} of them to convergence; more time may improve them."
        )
        condition = self.conditioning.scaled
        size = f"{condition:.0f}" if 1e3 <= condition < 1e6 else f"{condition:.3g}"
        reached = f"condition number {size}, at most {IDENTIFIES:g} allowed"
        if condition <= IDENTIFIES:
            return f"This motion identifies all base parameters: {reached}. {search}"
        return (
            f"This motion does not identify all base parameters: {reached}. {search} Search longer "
            "(--seconds), allow more speed and acceleration, take more --harmonics; or identify "
            "equal legs together with --shared."
        )

    def with_leads(self, periods: int = 1) -> LedMotion:
        """Return the trajectory from rest to rest: lead-in, so many periods, lead-out."""
        return LedMotion(self.motion, self.lead, periods)

    def held_out(self, rate: float = 1000.0) -> RepeatedCycle:
        """Return a pick-and-place cycle within the same limits, to validate a model with.

        See `held_out_cycle` for `rate` and errors.
        """
        return held_out_cycle(self.motion.robot, self.limits, rate)

    def slow(self) -> LedMotion:
        """Return passages that show how friction falls with speed (Stribeck), from rest to rest.

        The trajectory's own curve, once and in ten of its periods, at a rate that rises from 0 to a
        fifth and falls again: each joint turns back as often as in a period, and crosses all speeds
        between rest and a fifth of its usual ones slowly. What keeps limits faster keeps them so.
        """
        period = _SLOWER * self.motion.period
        lead = Lead(period, _SLOWER * self.lead.phase)
        return LedMotion(replace(self.motion, period=period), lead, periods=0)

    def write(
        self,
        path: str | Path,
        rate: float = 1000.0,
        periods: int = 3,
        layout: MotionLayout | None = None,
        held_out: RepeatedCycle | None = None,
        slow: LedMotion | None = None,
    ) -> list[Path]:
        """Write what `pteron excite` writes: motions, and descriptions of their logs beside them.

        motion.csv (or .parquet) and motion.toml, as `write_csv` and `write_toml` do; and
        motion-held-out.csv and .toml of what is given to be held out, motion-slow.csv and .toml of
        slow passages. All of them, or none.

        Parameters
        ----------
        path : str or path
            Of the motion; it ends in ``.csv`` or ``.parquet``.
        rate : float
            Samples a second.
        periods : int
            How many periods there are between lead-in and lead-out.
        layout : MotionLayout, optional
            Columns, units and how a CSV file is written.
        held_out : RepeatedCycle, optional
            Such as `held_out` returns.
        slow : LedMotion, optional
            Such as `slow` returns.

        Raises
        ------
        OutputError
            If they cannot be written.
        DataError
            If there would be no sample, or the layout does not fit the machine.
        """
        layout = layout or MotionLayout()
        check_sampling(self.motion.period, rate, periods)
        paths = motion_paths(path, layout)
        motions: dict[Path, tuple[Movement, Description]] = {
            paths[0]: (self.with_leads(periods), self._description(periods, layout))
        }
        if held_out is not None:
            motions[paths[1]] = held_out, _describe(held_out, layout)
        if slow is not None:
            motions[paths[2]] = slow, _describe(slow, layout)
        return write_motions(motions, layout, rate)

    def frame(
        self, rate: float = 1000.0, periods: int = 1, layout: MotionLayout | None = None
    ) -> pl.DataFrame:
        """Return the trajectory, lead-in and lead-out included, as a data frame.

        A row for each sample, `rate` a second, from rest to rest. Columns, in SI units: t; rho1
        ... (theta1 ... at cranks); x y z phi; drho1 ...; ddrho1 ...; dx ...; ddx ...; force1 ...
        (torque1 ...). A `layout` selects, renames and converts them.
        """
        check_sampling(self.motion.period, rate, periods)
        return (layout or MotionLayout()).frame(self.with_leads(periods), rate)

    def write_csv(
        self,
        path: str | Path,
        rate: float = 1000.0,
        periods: int = 1,
        layout: MotionLayout | None = None,
    ) -> Path:
        """Write the trajectory for a controller to a CSV (or Parquet) file, from rest to rest.

        Columns t; rho1 ...; x y z phi; drho1 ...; ddrho1 ...; dx ...; ddx ...; force1 ..., in SI
        units; theta and torque at a crank; by a layout, some of them, under other names and in
        other units. The forces are what the drives need by the machine's nominal inertia and, where
        its file knows it, friction (`pteron.drive_forces`).

        Parameters and errors are those of `write`.
        """
        layout = layout or MotionLayout()
        return write_table(self.frame(rate, periods, layout), path, layout.dialect)

    def write_toml(
        self, path: str | Path, periods: int = 1, layout: MotionLayout | None = None
    ) -> Path:
        """Write what an evaluation of the log needs, of as many periods as `write_csv` wrote.

        That is the period, where the periodic part begins and ends (s from the first row), the
        assembly mode (from 1), and the layout. Where modes have no number throughout, a log is in
        that of the home pose unless it says otherwise, as the motion is.
        """
        return write_description(self._description(periods, layout or MotionLayout()), path)

    def _description(self, periods: int, layout: MotionLayout) -> Description:
        """Return the description of a log of so many periods: its columns and periodic part."""
        led = self.with_leads(periods)
        described = _describe(led, layout)
        return replace(described, period=self.motion.period, start=led.start, end=led.end)

    def as_dict(self) -> dict[str, Any]:
        """Return everything but the machine as plain data."""
        motion = self.motion
        return {
            "robot": motion.robot.name,
            "machine": machine_record(motion.robot),
            **json_fields(
                criterion=self.criterion,
                seed=self.seed,
                seconds=self.seconds,
                interrupted=self.interrupted,
                conditioning=self.conditioning,
                random=self.random,
                draws=self.draws,
                gain=self.gain,
            ),
            **json_fields(limits=self.limits),
            **json_fields(margins=self.margins.each),
            **json_fields(starts=self.starts),
            "motion": {
                **json_fields(space=motion.space, period=motion.period),
                "lead": self.lead._asdict(),
                "assembly_mode": _mode_of(motion),
                **json_fields(center=motion.center, cosines=motion.cosines, sines=motion.sines),
            },
        }


def _describe(movement: Movement, layout: MotionLayout) -> Description:
    """Return the description of a movement's log."""
    return replace(layout.description(movement.robot), assembly_mode=_mode_of(movement))


def _mode_of(movement: Movement) -> int | None:
    """Return the assembly mode of a movement, from 1; None where modes have no fixed number."""
    robot = movement.robot
    if not closure_of(robot).keeps_modes:
        return None
    return 1 + int(assembly_mode(robot, movement.states(np.zeros(1)).pose[0]))
