"""An exciting trajectory: the motion, how good it is, and what it leaves of every limit."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from pteron.atomic import write_text
from pteron.equations.machine import closure_of
from pteron.errors import DataError
from pteron.identification.excitation.conditioning import Conditioning
from pteron.identification.excitation.fourier import FourierMotion, states
from pteron.identification.excitation.limits import Limits, Margins
from pteron.identification.excitation.program import Criterion
from pteron.kinematics import assembly_mode
from pteron.kinematics.evaluate import unchecked
from pteron.tables import write_table

_MOST_SAMPLES = 10_000_000


@dataclass(frozen=True)
class Start:
    """What became of one start.

    Attributes
    ----------
    draw : int
        Which of the random motions it was, counted from 0.
    before, after : Conditioning
        How good the random motion was, and the best that was made of it.
    finished : bool
        Whether it was improved thoroughly, rather than left for better ones or cut short.
    """

    draw: int
    before: Conditioning
    after: Conditioning
    finished: bool


@dataclass(frozen=True, eq=False)
class Excitation:
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
    starts: tuple[Start, ...]
    draws: int
    seed: int
    seconds: float
    interrupted: bool

    @property
    def gain(self) -> float:
        """How many times the scaled condition number of the best random motion is larger."""
        return self.random.scaled / self.conditioning.scaled

    def frame(self, rate: float = 1000.0, periods: int = 1) -> pl.DataFrame:
        """Return the trajectory sampled for a controller (see `write_csv`)."""
        check_sampling(self.motion.period, rate, periods)
        motion, robot = self.motion, self.motion.robot
        times = np.arange(round(periods * motion.period * rate)) / rate
        state = states(motion, times)
        path = state.pose, state.velocity, state.acceleration
        columns = {"t": times}
        for order, names, values in (
            ("", robot.joint_names, state.joints),
            ("", robot.coordinates, state.pose),
            ("d", robot.joint_names, state.rates),
            ("dd", robot.joint_names, state.accelerations),
            ("d", robot.coordinates, state.velocity),
            ("dd", robot.coordinates, state.acceleration),
            ("", robot.force_names, unchecked(robot, "inverse_dynamics", *path)),
        ):
            columns |= {f"{order}{name}": values[:, k] for k, name in enumerate(names)}
        return pl.DataFrame(columns)

    def write_csv(self, path: str | Path, rate: float = 1000.0, periods: int = 1) -> Path:
        """Write the trajectory for a controller to a CSV (or Parquet) file.

        Columns t; rho1 ...; x y z phi; drho1 ...; ddrho1 ...; dx ...; ddx ...; force1 ..., in SI
        units; theta and torque at a crank. The forces are those of the machine's nominal inertia,
        without friction. The motion is periodic: the sample after the last is the first one again.
        It does not begin at rest.

        Parameters
        ----------
        path : str or path
            It ends in ``.csv`` or ``.parquet``.
        rate : float
            Samples a second.
        periods : int
            How many periods.

        Raises
        ------
        OutputError
            If it cannot be written.
        DataError
            If there would be no sample.
        """
        return write_table(self.frame(rate, periods), path)

    def write_toml(self, path: str | Path) -> Path:
        """Write what an evaluation of the log needs: period and assembly mode (from 1).

        Where modes have no number throughout, a log is in that of the home pose unless it says
        otherwise, as the motion is.
        """
        text = f"[motion]\nperiod = {self.motion.period!r}\n"
        if self._assembly_mode is not None:
            text += f"assembly_mode = {self._assembly_mode}\n"
        return write_text(path, text)

    @property
    def _assembly_mode(self) -> int | None:
        """The pose of `direct_kinematics` throughout the motion, from 1."""
        robot = self.motion.robot
        if not closure_of(robot).keeps_modes:
            return None
        return 1 + int(assembly_mode(robot, states(self.motion, np.zeros(1)).pose[0]))

    def as_dict(self) -> dict[str, Any]:
        """Return everything but the machine as plain data."""
        motion = self.motion
        return {
            "robot": motion.robot.name,
            "criterion": self.criterion,
            "seed": self.seed,
            "seconds": self.seconds,
            "interrupted": self.interrupted,
            "conditioning": asdict(self.conditioning),
            "random": asdict(self.random),
            "draws": self.draws,
            "gain": self.gain,
            "limits": asdict(self.limits),
            "margins": [asdict(margin) for margin in self.margins],
            "starts": [asdict(start) for start in self.starts],
            "motion": {
                "space": motion.space,
                "period": motion.period,
                "assembly_mode": self._assembly_mode,
                "center": motion.center.tolist(),
                "cosines": motion.cosines.tolist(),
                "sines": motion.sines.tolist(),
            },
        }


def check_sampling(period: float, rate: float, periods: int) -> None:
    """Refuse, before any work, a period and samples a second that give no table."""
    if not 0.0 < period < np.inf:
        raise DataError(f"period: {period} s given, a number above 0 expected")
    if not 0.0 < rate < np.inf:
        raise DataError(f"rate: {rate} given, samples a second above 0 expected")
    if periods < 1:
        raise DataError(f"periods: {periods} given, 1 or more expected")
    count = periods * period * rate
    if not 0.5 < count <= _MOST_SAMPLES:
        raise DataError(
            f"rate: {rate:g} a second gives {count:.0f} samples in {periods * period:g} s; 1 to "
            f"{_MOST_SAMPLES} are served"
        )
