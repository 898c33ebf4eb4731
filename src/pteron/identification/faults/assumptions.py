"""Discrete assumptions of the machine's file that a log contradicts, each tried by itself.

Gear ratio or lead by a factor, gravity along another axis, another working mode, another order or
sign of columns: none of these is small, so that no slope tells it. Each is tried on a few hundred
samples, with all inertial parameters and friction free; what is left of the forces decides.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations
from typing import Literal

import numpy as np

from pteron.equations.machine import closure_of
from pteron.errors import PteronError, UnlikelyValue
from pteron.identification.logs import Log
from pteron.identification.observation import scale_columns
from pteron.identification.signals import Preprocessing
from pteron.json_values import json_fields
from pteron.kernels import Array
from pteron.kinematics import assembly_modes, direct_kinematics, follow
from pteron.kinematics.evaluate import evaluate_unchecked
from pteron.manipulator import Manipulator
from pteron.manipulator.variants import elbows_of, mode_elbows, with_elbows

_LOOK = 12_000
"""Most rows of the log from which these samples are drawn."""

_SAMPLES = 400
"""Number of samples on which each assumption is tried: 800 equations or more for some 40 values."""

_DECISIVE = 3.0
"""Factor by which another assumption must reduce the residual forces to be accepted."""

_EXPLAINED = 0.03
"""Residual forces, as a share of the forces, up to which they count as explained, or three times
their noise: with all parameters free other machines' logs leave 10 % or more."""

_EXPLAINED_ALONE = 0.06
"""The same where the joints have no poses as the file has it: few assumptions give them any."""

_AS_GOOD = 1.3
"""Residual, over the least one, up to which the assumption that comes first is taken."""

_AT_NOISE, _AS_GOOD_AT_NOISE = 1.15, 1.05
"""Least residual, over the forces' noise, that is noise alone, and the residual over it up to which
another assumption is as good then: of 800 equations with the same noise a wrong one leaves more."""

_FACTORS = (0.5, 2.0)
"""Factors of gear ratios: double and half leads and counts. With smaller ones joints hardly move,
and free parameters explain the forces of any log."""

_MOST_LOST = 0.02
"""Share of the samples, at most, that an assumption may leave without a pose."""

_MODES = 16
"""Working modes that are tried, those of fewest other elbows first."""

_FEW_LEGS = 4
"""Legs up to which exchanges of two are all that symmetry allows."""

_MOST_LEGS = 7
"""Legs up to which symmetries are looked for, in 5040 orders."""

_POINTS = ("guide_point", "platform_point")
"""Points of legs that a symmetry leads to those of other legs."""

_ALIKE = 0.01
"""Difference of distances of points, over the largest, up to which they count as the same."""

AssumptionName = Literal["ratio", "gravity", "mode"]


@dataclass(frozen=True)
class Assumption:
    """An assumption that explains the log better than that of the machine's file.

    Attributes
    ----------
    fault : {"ratio", "gravity", "mode"}
        Gear ratio, direction of gravity, working mode.
    message : str
        The fault and its remedy, in a sentence.
    before, after : float
        What is left of the forces, over them, as the file says, and so.
    """

    fault: AssumptionName
    message: str
    before: float
    after: float

    def as_dict(self) -> dict[str, object]:
        """Return the assumption as plain data."""
        return json_fields(
            fault=self.fault, message=self.message, before=self.before, after=self.after
        )


@dataclass(frozen=True)
class _Samples:
    """Samples of a log: joints, rates, accelerations and forces (R, n), the pose of the start."""

    joints: Array
    rates: Array
    accelerations: Array
    forces: Array
    start: tuple[float, ...]


def find_contradiction(
    robot: Manipulator, log: Log, how: Preprocessing, rotors: Array
) -> Assumption | None:
    """Return the assumption that explains a log's forces far better than the file does.

    `rotors` (n,) is the inertia that motors are known to add at the joints. None where no
    assumption reduces the residuals to a third.
    """
    samples = _samples(log, how, rotors)
    if samples is None:
        return None
    error_before = _unexplained_share(robot, samples)
    noise = how.force_noise / np.maximum(samples.forces.std(axis=0), 1e-300)
    least = _EXPLAINED if np.isfinite(error_before) else _EXPLAINED_ALONE
    explained = max(least, 3.0 * float(noise.max()))
    if error_before < explained:
        return None
    tried: list[Assumption] = []
    for fault, message, other, changed in _alternatives(robot, samples):
        error_after = _unexplained_share(other, changed)
        if error_after < explained and error_after * _DECISIVE < error_before:
            tried.append(
                Assumption(
                    fault, _sentence(message, error_before, error_after), error_before, error_after
                )
            )
    if not tried:
        return None
    least = min(assumption.after for assumption in tried)
    at_noise = least <= _AT_NOISE * float(noise.max())
    as_good = (_AS_GOOD_AT_NOISE if at_noise else _AS_GOOD) * least
    first = next(assumption.fault for assumption in tried if assumption.after <= as_good)
    return min(
        (assumption for assumption in tried if assumption.fault == first),
        key=lambda assumption: assumption.after,
    )


def hidden_orders(robot: Manipulator, log: Log, how: Preprocessing) -> str:
    """Return a sentence on other orders of the legs that a log does not show; empty if none.

    Mirror images of each other, for instance: another machine, mirrored, explains the forces as
    well. Of few legs exchanges of two are tried, of more the orders that symmetry allows.
    """
    count = len(robot.legs)
    samples = _samples(log, how, np.zeros(count))
    if samples is None:
        return ""
    usual = tuple(range(count))
    if count <= _FEW_LEGS:
        pairs = combinations(usual, 2)
        orders = [tuple({i: j, j: i}.get(k, k) for k in usual) for i, j in pairs]
    else:
        orders = _symmetries(robot)
    error_before = _unexplained_share(robot, samples) if orders else np.inf
    hidden = []
    for order in orders:
        parts = {k: v[:, list(order)] for k, v in vars(samples).items() if k != "start"}
        if _unexplained_share(robot, replace(samples, **parts)) <= _AS_GOOD * error_before:
            hidden.append(order)
    if not hidden:
        return ""
    if count <= _FEW_LEGS:
        pairs_of = (" and ".join(str(k + 1) for k in usual if o[k] != k) for o in hidden)
        return (
            f"These logs cannot show whether legs {', or '.join(pairs_of)}, are exchanged in the "
            "file: as mirror images of each other they explain the forces as well."
        )
    names = ", or ".join("-".join(str(k + 1) for k in order) for order in hidden)
    return (
        f"These logs cannot show whether the legs are in another order, {names}: the mirrored or "
        "rotated machine explains the forces as well."
    )


def _symmetries(robot: Manipulator) -> list[tuple[int, ...]]:
    """Return the permutations of the legs that preserve distances of guide and platform points."""
    count = len(robot.legs)
    if count > _MOST_LEGS:
        return []
    points = [np.array([getattr(leg, name, np.nan) for leg in robot.legs]) for name in _POINTS]
    distances = [np.linalg.norm(p[:, None] - p, axis=-1) for p in points]
    limits = [_ALIKE * d.max() for d in distances]
    orders = []
    for order in permutations(range(count)):
        rows = np.ix_(order, order)
        pairs = zip(distances, limits, strict=True)
        if all(np.abs(d[rows] - d).max() <= limit for d, limit in pairs):
            orders.append(order)
    return orders[1:]


def _sentence(message: tuple[str, str], error_before: float, error_after: float) -> str:
    """Return the sentence on a fault with the errors of the forces before and after."""
    fault, remedy = message
    was = f"{100.0 * error_before:.2g} % of the forces is left"
    if not np.isfinite(error_before):
        was = "the joints have no poses"
    return f"{fault}: as the file has it {was}, so {100.0 * error_after:.2g} %; {remedy}."


def _samples(log: Log, how: Preprocessing, rotors: Array) -> _Samples | None:
    """Return some 400 samples of the longest stretch without a gap; None where it is too short."""
    longest = max(log.segments, key=lambda part: part.stop - part.start)
    part = log.part(longest.start, min(longest.stop, longest.start + _LOOK))
    edge = how.differentiator.edge
    if part.rows <= 2 * edge + _SAMPLES // 4:
        return None
    moved = how.differentiator.differentiate(part, edge)
    q, rates, accelerations = moved.motion
    rows = np.unique(np.linspace(0, len(q) - 1, _SAMPLES).astype(int))
    forces = moved.forces - rotors * accelerations
    return _Samples(q[rows], rates[rows], accelerations[rows], forces[rows], how.start)


def _alternatives(
    robot: Manipulator, s: _Samples
) -> Iterator[tuple[Literal["ratio", "gravity", "mode"], tuple[str, str], Manipulator, _Samples]]:
    """Yield alternative assumptions, each with message, machine and samples to evaluate it on."""
    at_home = evaluate_unchecked(robot, "joint_coordinates", np.array(s.start))
    for factor in _FACTORS:
        for middle, where in ((at_home, "home"), (np.zeros_like(at_home), "zero")):
            moved = replace(
                s,
                joints=middle + factor * (s.joints - middle),
                rates=factor * s.rates,
                accelerations=factor * s.accelerations,
            )
            what = (
                f"All joints move {factor:g} times as far from their {where} as the log says, as "
                "where a gear ratio, a lead or a number of counts is off by that factor"
            )
            remedy = "check the ratio, lead or counts that positions are computed with"
            yield "ratio", (what, remedy), robot, moved
    yield from _turned_gravity(robot, s)
    yield from _other_modes(robot, s)


def _turned_gravity(
    robot: Manipulator, s: _Samples
) -> Iterator[tuple[Literal["gravity"], tuple[str, str], Manipulator, _Samples]]:
    """Yield the machine with gravity along each axis and sense, with the message for each."""
    g = np.array(robot.gravity)
    size = float(np.linalg.norm(g)) or 9.81
    for axis in range(3):
        for sign in (-1.0, 1.0):
            turned = np.zeros(3)
            turned[axis] = sign * size
            x, y, z = turned.tolist()
            if np.abs(turned - g).max() < 1e-3 * size:
                continue
            name = f"{'-' if sign < 0.0 else ''}{'xyz'[axis]}"
            message = (
                f"Gravity is along {name}, not as in the machine's file",
                f"write gravity = [{', '.join(f'{v:g}' for v in turned)}] into the file",
            )
            yield "gravity", message, replace(robot, gravity=(x, y, z)), s


def _other_modes(
    robot: Manipulator, s: _Samples
) -> Iterator[tuple[Literal["mode"], tuple[str, str], Manipulator, _Samples]]:
    """Yield the machine in its other working modes, with the message for each."""
    drawn = elbows_of(robot)
    fields = [(i + 1, name) for i, leg in enumerate(robot.legs) for name in leg.signs]
    modes = [
        ([k for k, sign in enumerate(elbows) if sign != drawn[k]], elbows)
        for elbows in mode_elbows(robot)
        if elbows != drawn
    ]
    # One elbow is most often wrong, or all of them.
    most = max((len(changed) for changed, _ in modes), default=0)
    modes.sort(key=lambda pair: (len(pair[0]) not in (1, most), len(pair[0]), pair[0]))
    for changed, elbows in modes[:_MODES]:
        legs: dict[str, list[str]] = {}
        for leg, name in (fields[k] for k in changed):
            legs.setdefault(name, []).append(str(leg))
        places = {
            name: ("s" * (len(numbers) > 1), ", ".join(numbers)) for name, numbers in legs.items()
        }
        sides = (
            f"the {name.replace('_', ' ')}{plural} of leg{plural} {numbers}"
            for name, (plural, numbers) in places.items()
        )
        signs = (
            f"of {name} in leg{plural} {numbers}" for name, (plural, numbers) in places.items()
        )
        message = (
            f"The machine works in another working mode: {' and '.join(sides)} "
            f"{'are' if len(changed) > 1 else 'is'} on the other side",
            f"change the sign {' and '.join(signs)} of the file",
        )
        yield "mode", message, with_elbows(robot, elbows), s


def _unexplained_share(robot: Manipulator, s: _Samples) -> float:
    """Return the unexplained share of the forces' variation, with all parameters free.

    Infinite where the joints have no poses.
    """
    try:
        with warnings.catch_warnings():
            # Coordinates that look like degrees are one of the things that are tried.
            warnings.simplefilter("ignore", UnlikelyValue)
            paths = list(_paths(robot, s))
    except PteronError:
        return np.inf
    return min((_residual(robot, pose, s) for pose in paths), default=np.inf)


def _paths(robot: Manipulator, s: _Samples) -> Iterator[Array]:
    """Yield the poses (R, m) of joints in each of the assembly modes that have them."""
    if closure_of(robot).closed_form:
        modes = assembly_modes(robot, s.joints)
        for k in range(modes.shape[1]):
            yield np.ascontiguousarray(modes[:, k])
        return
    starts: Sequence[Array] = [np.array(s.start)]
    first = direct_kinematics(robot, s.joints[0], on_failure="nan")
    starts = [*starts, *(pose for pose in np.atleast_2d(first) if np.isfinite(pose).all())]
    for start in starts[:3]:
        yield follow(robot, s.joints, start, on_failure="nan")


def _residual(robot: Manipulator, pose: Array, s: _Samples) -> float:
    """Return the share of the forces' variation that a machine at poses leaves unexplained."""
    good = np.isfinite(pose).all(axis=1)
    if good.mean() < 1.0 - _MOST_LOST:
        return np.inf
    pose = np.ascontiguousarray(pose[good])
    joints = evaluate_unchecked(robot, "joint_coordinates", pose)
    # Modes that direct kinematics does not tell apart have other joints.
    if not np.abs(joints - s.joints[good]).max() < 1e-3 * max(1.0, np.abs(s.joints).max()):
        return np.inf
    velocity, acceleration = evaluate_unchecked(
        robot, "platform_motion", pose, s.rates[good], s.accelerations[good]
    )
    rigid = evaluate_unchecked(robot, "regressor", pose, velocity, acceleration)
    rates, n = s.rates[good], s.rates.shape[1]
    diagonal = np.eye(n)
    friction = [part[..., None] * diagonal for part in (np.sign(rates), rates, np.ones_like(rates))]
    matrix = np.concatenate([rigid, *friction], axis=-1)
    spread = np.maximum(s.forces[good].std(axis=0), 1e-300)
    used = np.abs(rates) > 0.05 * np.sqrt((rates**2).mean(axis=0))
    used &= np.isfinite(matrix).all(axis=-1)
    flat, forces = (matrix / spread[:, None])[used], (s.forces[good] / spread)[used]
    if len(flat) < 2 * flat.shape[1]:
        return np.inf
    columns = scale_columns(flat)[0]
    basis, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    basis = basis[:, sizes > 1e-9 * sizes[0]]
    residuals = forces - basis @ (basis.T @ forces)
    means = (s.forces[good] / spread).mean(axis=0)
    centred = forces - np.broadcast_to(means, used.shape)[used]
    return float(np.linalg.norm(residuals) / max(float(np.linalg.norm(centred)), 1e-300))
