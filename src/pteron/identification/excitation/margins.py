"""How far a motion stays from its limits, over the whole period."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pteron.errors import ModelError
from pteron.identification.excitation.fourier import FourierMotion, State, states
from pteron.identification.excitation.limits import (
    PER_SLIDER,
    UNITS,
    Limits,
    per_slider,
    slider_sizes,
)
from pteron.kernels import Array, numeric
from pteron.manipulator import Manipulator
from pteron.workspace.reserve import clearances

__all__ = ["Margin", "Margins", "check_rest", "margins", "relative_margins"]

_REFINED = 33
"""Samples between the neighbours of the tightest sample, for its exact place."""


@dataclass(frozen=True)
class Margin:
    """How near a motion comes to one limit.

    Attributes
    ----------
    limit : str
        The name of the limit, a field of `Limits`.
    least : float
        What is left of it at the tightest instant, in `unit`; below 0 it is violated.
    leg : int or None
        The leg it happens to, counted from 1; None for the platform's orientation.
    time : float
        When, s.
    unit : str
    """

    limit: str
    least: float
    leg: int | None
    time: float
    unit: str


@dataclass(frozen=True)
class Margins:
    """The least margin to every limit that is in force.

    Attributes
    ----------
    each : tuple of Margin
    samples : int
        Instants of the period that were looked at; near the tightest ones, many more.
    """

    each: tuple[Margin, ...]
    samples: int

    @property
    def kept(self) -> bool:
        """Whether no limit is violated."""
        return all(margin.least >= 0.0 for margin in self.each)

    def __iter__(self) -> Iterator[Margin]:
        return iter(self.each)

    def __getitem__(self, limit: str) -> Margin:
        return {margin.limit: margin for margin in self.each}[limit]


def margins(motion: FourierMotion, limits: Limits, samples: int = 4000) -> Margins:
    """Return how far a motion stays from its limits.

    Parameters
    ----------
    motion : FourierMotion
        The motion.
    limits : Limits
        What it is to keep.
    samples : int
        Instants, evenly over the period, at which every limit is looked at.

    Returns
    -------
    Margins

    Examples
    --------
    >>> import pteron
    >>> from pteron.identification.excitation import Limits, margins, random_excitation
    >>> motion = random_excitation(pteron.load("tripteron"), harmonics=2, seed=1)
    >>> margins(motion, Limits()).kept
    True
    """
    times = motion.uniform_times(samples)
    step = motion.period / samples
    found = []
    coarse = _margins_at(motion, limits, times)
    for name, values in coarse.items():
        tightest = times[int(values.min(axis=-1).argmin())]
        near = tightest + np.linspace(-step, step, _REFINED)
        values = _margins_at(motion, limits, near)[name]
        k, leg = np.unravel_index(int(values.argmin()), values.shape)
        found.append(
            Margin(
                name,
                float(values[k, leg]),
                None if name == "regularity" else int(leg) + 1,
                float(near[k] % motion.period),
                UNITS[name],
            )
        )
    return Margins(tuple(found), samples)


def relative_margins(motion: FourierMotion, limits: Limits, times: Array) -> dict[str, Array]:
    """Return the margins at times (T,), each over its limit's size: (T, n), or (T, 1).

    Sizes are 1 for sines and regularity, half its range for a slider, else the limit itself.
    """
    return {
        name: values / _size(motion.robot, limits, name)
        for name, values in _margins_at(motion, limits, times).items()
    }


def check_rest(robot: Manipulator, home: Array, limits: Limits) -> None:
    """Refuse limits that the machine at rest in its home pose does not keep.

    Raises
    ------
    ModelError
        Naming the limit, and what the machine has there.
    """
    zero = np.zeros_like(home)
    rest = State(home, zero, zero, numeric(robot, "slider_coordinates")(home), zero, zero)
    rows = State(*(value[None] for value in rest))
    for name, values in _margins_of(robot, limits, rows).items():
        leg = int(values[0].argmin())
        if values[0, leg] > 0.0:
            continue
        whose = "the platform" if name == "regularity" else f"leg {leg + 1}"
        given = getattr(limits, name)
        wanted = f"at most {given}" if name == "force" else f"at least {given:g}"
        has = (
            per_slider(limits, name, robot)[leg] - values[0, leg]
            if name == "force"
            else (given + values[0, leg])
        )
        raise ModelError(
            f"limits: {name} of {wanted} {UNITS[name]}".rstrip()
            + f" is impossible: {whose} of {robot.name} has {has:.4g} at rest in the home pose, "
            "the best one; loosen it"
        )


def _margins_at(motion: FourierMotion, limits: Limits, times: Array) -> dict[str, Array]:
    return _margins_of(motion.robot, limits, states(motion, times))


def _margins_of(robot: Manipulator, limits: Limits, state: State) -> dict[str, Array]:
    """Return every limit's margins (T, n) or (T, 1), -inf where the machine cannot be."""
    sine = numeric(robot, "reach")(state.pose)[2]
    found = {"elbow_sine": sine - limits.elbow_sine}
    if robot.platform.turns:
        regularity = np.abs(numeric(robot, "regularity")(state.pose))[:, None]
        found["regularity"] = regularity - limits.regularity
    if any(leg.slider_limits for leg in robot.legs):
        found["slider_clearance"] = clearances(robot, state.sliders) - limits.slider_clearance
    found["speed"] = per_slider(limits, "speed", robot) - np.abs(state.rates)
    found["acceleration"] = per_slider(limits, "acceleration", robot) - np.abs(state.accelerations)
    if limits.force is not None:
        forces = numeric(robot, "inverse_dynamics")(state.pose, state.velocity, state.acceleration)
        found["force"] = per_slider(limits, "force", robot) - np.abs(forces)
    return {name: np.where(np.isnan(values), -np.inf, values) for name, values in found.items()}


def _size(robot: Manipulator, limits: Limits, name: str) -> Array:
    if name in PER_SLIDER:
        return per_slider(limits, name, robot)
    return slider_sizes(robot) if name == "slider_clearance" else np.ones(1)
