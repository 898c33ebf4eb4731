"""What faults of a log, or of a machine, add to its forces F = W beta: columns to try.

A small fault adds its size times a column that the fit itself tells: a delay of the forces, for
one, adds its time times minus their derivative. `Suspects` puts these columns behind the model's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline  # type: ignore[import-untyped]

from pteron.equations.friction import passive_joints
from pteron.identification.faults.moved import Moved, lengths_of
from pteron.identification.faults.suspicion import Fault
from pteron.identification.model import Model
from pteron.identification.signals import States
from pteron.identification.signals.filters import smoothed
from pteron.kernels import Array
from pteron.kinematics.evaluate import unchecked
from pteron.manipulator import Manipulator, parameters

_STRIBECK = (0.05, 0.15, 0.4)
"""Speeds at which friction may fall, over each joint's root mean square: all are tried."""

_FEWEST = 8

_MOTION = ("joint_rates", "joint_accelerations", "velocity", "acceleration")

_STEP = 1e-6
"""Change over which forces are differenced: m, rad, or a share of a joint's range."""


@dataclass(frozen=True)
class Motion:
    """States, and what a fit says of the forces there.

    `usual` is the root mean square rate of each joint in the log (n,), `along` the time (R,) from
    -0.5 at the log's beginning to 0.5 at its end. Columns that are smooth and costly are worked out
    at every `stride`-th state. A `cutoff`, Hz, is for loads that are to be differentiated.
    """

    model: Model
    values: Array
    states: States
    usual: Array
    along: Array
    stride: int = 1
    cutoff: float | None = None

    @cached_property
    def matrix(self) -> Array:
        """The model's own columns (R, n, p)."""
        return self.model.matrix(self.states)

    @cached_property
    def forces(self) -> Array:
        """Forces of the fit (R, n)."""
        return np.asarray(self.matrix @ self.values)

    @cached_property
    def smooth(self) -> Array:
        """The same without dry friction, which jumps (R, n)."""
        dry = np.array([kind in ("coulomb", "stribeck") for kind in self.model.kinds])
        return np.asarray(self.matrix @ np.where(dry, 0.0, self.values))

    @cached_property
    def load(self) -> Array:
        """Those of the bodies alone (R, n)."""
        bodies = np.array([kind == "base" for kind in self.model.kinds])
        return np.asarray(self.matrix @ np.where(bodies, self.values, 0.0))

    @cached_property
    def some(self) -> NDArray[np.int64]:
        """Rows of every `stride`-th state, the first and the last among them."""
        rows = len(self.states)
        return np.unique(
            np.linspace(0, rows - 1, max(rows // self.stride, min(rows, 8))).astype(int)
        )

    @cached_property
    def _moved(self) -> Moved:
        base, drawn = self.model.base, parameters(self.model.robot)
        change = self.values[: base.rank] - base.grouping @ drawn
        # As drawn, but with the base parameters of the fit.
        some = self.states.part(self.some)
        return Moved(self.model.robot, drawn + base.selection @ change, some)

    def moved(self, columns: Callable[[Moved], Array]) -> Array:
        """Return columns (R, n, k) that tell of a machine a little different."""
        found = columns(self._moved)
        if len(self.some) == len(self.states):
            return found
        return np.asarray(make_interp_spline(self.some, found, k=3)(np.arange(len(self.states))))

    @property
    def direction(self) -> Array:
        """The sign of each joint's rate (R, n)."""
        return np.sign(self.states.joint_rates)

    def rate(self, signal: Array) -> Array:
        """Return the derivative by time of signals (R, n)."""
        return np.asarray(np.gradient(signal, self.states.time, axis=0, edge_order=2))


@dataclass(frozen=True)
class Family:
    """Columns that belong to one fault.

    `sizes` names what each of them is multiplied by, and `columns` returns them, (R, n, k). The
    machine itself has the fault where it is `of_machine`: then feed-forward should know it; else
    only the log has it. Sizes below zero are none where they must be `positive`, and beyond the
    `largest` they are another fault, told badly. Friction that falls with speed does so with a
    `speed`, over the usual one. Where the machine's forces change otherwise than those of the log,
    `effect` returns how: by a clock that is off all inertia is, and with it the mass that weighs.
    """

    name: Fault
    unit: str
    sizes: Callable[[Model], Sequence[str]]
    columns: Callable[[Motion], Array]
    of_machine: bool = True
    positive: bool = False
    largest: float = np.inf
    speed: float | None = None
    effect: Callable[[Motion], Array] | None = None

    def of_cycle(self, motion: Motion) -> Array:
        """Return what the machine has, and the model beside the fault has not, (R, n, k)."""
        return (self.effect or self.columns)(motion)


def _joints(model: Model) -> Sequence[str]:
    return [leg.joint.force + f"{i}" for i, leg in enumerate(model.robot.legs, start=1)]


def _each(signal: Array) -> Array:
    """Return signals (R, n) as columns (R, n, n), one for each actuator."""
    return np.asarray(signal[..., None] * np.eye(signal.shape[-1]))


def _stribeck(share: float, m: Motion) -> Array:
    return _each(m.direction * np.exp(-((m.states.joint_rates / (share * m.usual)) ** 2)))


def _elasticity(m: Motion) -> Array:
    # The motor, where friction mostly is, is ahead of its joint by what the load deflects: the
    # joint is that much behind what was measured.
    load = m.load
    pace = (len(load) - 1) / float(np.ptp(m.states.time))
    if m.cutoff is not None and 2.0 * m.cutoff < pace:
        # Noise of the accelerations would be in both, the residuals and the column.
        load = smoothed(load, pace, m.cutoff)
    rate = m.rate(load)
    behind = load, rate, m.rate(rate)
    return m.moved(lambda moved: moved.give([part[m.some] for part in behind], _STEP))


def _drift(m: Motion) -> Array:
    later = m.along[:, None]
    return np.concatenate([_each(later * m.direction), _each(later + 0.0 * m.direction)], axis=-1)


def _weight(m: Motion) -> Array:
    still = {name: np.zeros_like(getattr(m.states, name)) for name in _MOTION}
    bodies = np.array([kind in ("base", "payload") for kind in m.model.kinds])
    matrix = m.model.matrix(replace(m.states, **still))
    return np.asarray(matrix @ np.where(bodies, m.values, 0.0))[..., None]


def _passive_legs(model: Model) -> Sequence[str]:
    return [
        "the platform" if j.leg is None else f"leg {j.leg}" for j in passive_joints(model.robot)
    ]


def _passive(m: Motion) -> Array:
    s = m.states
    return np.asarray(unchecked(m.model.robot, "passive_friction", s.pose, s.velocity))


DELAY = Family(
    "delay", "s", lambda m: ["delay"], lambda m: -m.rate(m.smooth)[..., None], of_machine=False
)

_OTHERS = (
    Family(
        "gravity",
        "rad",
        lambda m: ["tilt", "tilt"],
        lambda m: m.moved(lambda moved: moved.tilt(_STEP)),
        largest=0.2,
    ),
    Family(
        "clock",
        "",
        lambda m: ["weight"],
        _weight,
        largest=3.0,
        effect=lambda m: m.load[..., None],
    ),
    Family(
        "geometry",
        "m",
        lambda m: [f"leg {leg + 1}" for leg, _ in lengths_of(m.robot)],
        lambda m: m.moved(lambda moved: moved.lengths(_STEP)),
    ),
    *(
        Family("stribeck", "N", _joints, partial(_stribeck, share), positive=True, speed=share)
        for share in _STRIBECK
    ),
    Family("elasticity", "m/N", _joints, _elasticity, positive=True),
    Family("drift", "N", lambda m: [*_joints(m), *_joints(m)], _drift),
    Family("load", "", _joints, lambda m: _each(m.direction * np.abs(m.load)), positive=True),
    Family("passive", "N m s", _passive_legs, _passive, positive=True),
)


def families_of(robot: Manipulator) -> tuple[Family, ...]:
    """Return the faults that are told by name; a wrong scale is one actuator's, each is tried."""
    return (DELAY, *(_scale(i) for i in range(len(robot.legs))), *_OTHERS)


def _scale(i: int) -> Family:
    return Family(
        "scale",
        "",
        lambda model: _joints(model)[i : i + 1],
        lambda m: _each(m.forces)[..., i : i + 1],
        of_machine=False,
        largest=1.0,
    )


@dataclass(frozen=True)
class Suspects:
    """A model with the columns of faults behind its own; `observations_of` takes it as a model.

    `values` (p,) are those of the fit, `usual` (n,) and the log's `begin` and `end` as in `Motion`.
    """

    model: Model
    values: Array
    usual: Array
    begin: float
    end: float
    families: tuple[Family, ...]
    stride: int = 1
    cutoff: float | None = None

    @property
    def robot(self) -> Manipulator:
        """The machine."""
        return self.model.robot

    @cached_property
    def sizes(self) -> tuple[Sequence[str], ...]:
        """What each family's columns are multiplied by."""
        return tuple(family.sizes(self.model) for family in self.families)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all columns."""
        return (*self.model.names, *chain.from_iterable(self.sizes))

    @property
    def units(self) -> tuple[str, ...]:
        """Of all columns' sizes."""
        found = zip(self.families, self.sizes, strict=True)
        return (*self.model.units, *(family.unit for family, sizes in found for _ in sizes))

    @property
    def kinds(self) -> tuple[str, ...]:
        """What the columns are: the model's kinds, or the fault."""
        found = zip(self.families, self.sizes, strict=True)
        return (*self.model.kinds, *(family.name for family, sizes in found for _ in sizes))

    @cached_property
    def places(self) -> tuple[list[int], ...]:
        """Where each family's columns stand among all."""
        counts = [len(self.model.names), *map(len, self.sizes)]
        ends = np.cumsum(counts).tolist()
        return tuple(list(range(a, b)) for a, b in pairwise(ends))

    def motion(self, states: States, along: Array, stride: int = 1) -> Motion:
        """Return what the columns are made of, at times `along` (R,) as in `Motion`."""
        return Motion(self.model, self.values, states, self.usual, along, stride, self.cutoff)

    def matrix(self, states: States) -> Array:
        """Return all columns (R, n, p + k)."""
        along = (states.time - self.begin) / (self.end - self.begin) - 0.5
        motion = self.motion(states, along, self.stride)
        columns = [family.columns(motion) for family in self.families]
        return np.concatenate([motion.matrix, *columns], axis=-1)
