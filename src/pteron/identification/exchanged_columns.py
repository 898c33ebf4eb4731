"""Search for exchanged columns or wrong signs in a log, by how much better corrected data fit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations, product

import numpy as np

from pteron.arguments import join_words
from pteron.errors import DataError
from pteron.identification.estimators import weighted_least_squares
from pteron.identification.logs import Log
from pteron.identification.model import Model
from pteron.identification.observation import (
    LinearModel,
    Observations,
    observations_of,
    scale_columns,
)
from pteron.identification.plausibility import unphysical
from pteron.identification.signals import Preprocessing
from pteron.tolerances import ROOT_OF_ROUNDING

DECISIVE = 3.0
"""Factor by which a correction must reduce the error of the fit for a fault to count as found."""

_EXPLAINED = 0.3
"""Error of a fit, relative to the forces, below which it explains them."""

_ALIKE = 1.2
"""Error of a fit, over the least one, up to which it explains the forces as well."""

_ROWS = 4000
"""Rows of the observations, at least, to which longer ones are thinned."""

_LOOKED_INTO = 12
"""Most faults of equal fit, those of fewest changes, whose fits are tested for physical values."""

_ALL_ORDERS = 4
"""Joints of which all orders are tried: 23 others."""

_LISTED = 3
"""Equivalent faults that a message lists."""


@dataclass(frozen=True)
class ColumnFault:
    """A fault of columns: forces or joints exchanged or of wrong sign, or gravity reversed.

    `order` has the column, from 0, that belongs to each actuator; a sign is -1 where it is flipped.
    `before` and `after` are the errors of the fit relative to the forces, without and with the
    correction. `equivalents` are other faults, in words, that explain the forces as well.
    """

    forces: tuple[str, ...]
    joints: tuple[str, ...]
    order: tuple[int, ...]
    signs: tuple[int, ...]
    joint_order: tuple[int, ...]
    joint_signs: tuple[int, ...]
    before: float
    after: float
    gravity: bool = False
    equivalents: tuple[str, ...] = ()

    @property
    def changes(self) -> int:
        """Number of exchanges and flips that correct it; exchanged legs count once."""
        legs = self.order == self.joint_order
        orders = (self.order,) if legs else (self.order, self.joint_order)
        flips = self.signs.count(-1) + self.joint_signs.count(-1)
        return flips + sum(map(_exchanges, orders)) + self.gravity

    def message(self) -> str:
        """Return the fault as part of a sentence."""
        parts = []
        usual = tuple(range(len(self.order)))
        if self.gravity:
            parts.append("gravity points the other way than in the machine's file")
        if self.order == self.joint_order != usual:
            pairs = [f"leg {k + 1}" for k in usual if self.order[k] != k]
            parts.append(f"{join_words(pairs, 'and')} are exchanged, forces and joints alike")
        else:
            for names, order in ((self.joints, self.joint_order), (self.forces, self.order)):
                parts += _order_clauses(names, order)
        parts += _sign_clauses(self.joints, self.joint_order, self.joint_signs)
        if -1 not in self.joint_signs and self.signs.count(-1) == len(usual):
            parts.append("the forces, or all joints, have the sign flipped")
        else:
            parts += _sign_clauses(self.forces, self.order, self.signs)
        return " and ".join(parts)


def _exchanges(order: Sequence[int]) -> int:
    """Return the least number of swaps of two that turn an order into 0, 1, 2 ..."""
    unplaced, count = set(range(len(order))), len(order)
    while unplaced:
        at, count = unplaced.pop(), count - 1
        while (at := order[at]) in unplaced:
            unplaced.remove(at)
    return count


def _order_clauses(names: Sequence[str], order: Sequence[int]) -> Iterator[str]:
    """Yield a clause that states which columns are swapped or in another order, if any."""
    moved = [name for k, name in enumerate(names) if order[k] != k]
    if len(moved) == 2:
        yield f"{join_words(moved, 'and')} are swapped"
    elif moved:
        right = ", ".join(names[k] for k in order)
        yield f"{join_words(moved, 'and')} are in another order (they should be {right})"


def _sign_clauses(
    names: Sequence[str], order: Sequence[int], signs: Sequence[int]
) -> Iterator[str]:
    """Yield a clause that states which columns have the wrong sign, if any."""
    flipped = [names[order[k]] for k, sign in enumerate(signs) if sign < 0]
    if flipped:
        verb = "has" if len(flipped) == 1 else "have"
        yield f"{join_words(flipped, 'and')} {verb} the sign flipped"


def column_fault(model: Model, log: Log, preprocessing: Preprocessing) -> ColumnFault | None:
    """Return the exchange of columns, or of signs, that explains a log's forces far better.

    Of several that explain them equally well, one with positive friction and inertia is preferred,
    then the one of fewest changes. None if no exchange makes the error three times smaller, or
    makes negative inertia or friction positive; and where legs are redundant, whose equations mix
    all columns.
    """
    if model.robot.redundancy:
        return None
    # Without the mask of slow joints, which depends on the order of the joints.
    plain = replace(preprocessing, slow=np.zeros_like(preprocessing.slow))
    usual = observations_of(model, log, plain)
    unchanged = _unchanged_columns(model, usual.actuators)
    tried = _with_signs(unchanged, permutations(unchanged.order))
    candidates = [(fault, usual, model) for fault in _with_errors(usual, tried)]
    error = candidates[0][0].after
    candidates += _other_faults(unchanged, model, log, plain, error)
    faults = [replace(fault, before=error) for fault, _, _ in candidates]
    least = min(fault.after for fault in faults)
    limit = _ALIKE * max(least, ROOT_OF_ROUNDING)
    if not max(least, ROOT_OF_ROUNDING) * DECISIVE < error:
        # Forces that no order explains say nothing about signs.
        if error > _EXPLAINED:
            return None
        limit = _ALIKE * max(error, ROOT_OF_ROUNDING)
    alike = [k for k, fault in enumerate(faults) if fault.after <= limit]
    alike = sorted(alike, key=lambda k: (faults[k].changes, faults[k].after))[:_LOOKED_INTO]
    states = {k: _count_unphysical(faults[k], *candidates[k][1:]) for k in alike}
    first, *equivalents = sorted(
        alike, key=lambda k: (states[k], faults[k].changes, faults[k].after)
    )
    if faults[first].changes == 0:
        return None
    # Equal legs can be renamed in every fault: faults of more changes add nothing.
    most = states[first], faults[first].changes
    as_well = [faults[k].message() for k in equivalents if (states[k], faults[k].changes) <= most]
    return replace(faults[first], equivalents=tuple(as_well[:_LISTED]))


def exchanged_joints(
    model: LinearModel, log: Log, preprocessing: Preprocessing, error: float
) -> ColumnFault | None:
    """Return the exchange or sign of joints that fits best, if below a third of `error`."""
    unchanged = _unchanged_columns(model, log.joints.shape[1])
    best: ColumnFault | None = None
    for fault, observations in _joint_corrections(unchanged, model, log, preprocessing):
        (candidate,) = _with_errors(observations, [fault])
        if candidate.after * DECISIVE < (error if best is None else best.after * DECISIVE):
            best = replace(candidate, before=error)
    return best


def _unchanged_columns(model: LinearModel, n: int) -> ColumnFault:
    """Return a ColumnFault that corrects nothing: columns as recorded, errors infinite."""
    usual, upright = tuple(range(n)), (1,) * n
    names = model.robot.force_names, model.robot.joint_names
    return ColumnFault(*names, usual, upright, usual, upright, np.inf, np.inf)


def _with_signs(fault: ColumnFault, orders: Iterable[tuple[int, ...]]) -> list[ColumnFault]:
    """Return faults with all `orders` and all signs of the forces; unflipped ones first."""
    signs = list(product((1, -1), repeat=len(fault.order)))
    return [replace(fault, order=o, signs=s) for o in orders for s in signs]


def _other_faults(
    unchanged: ColumnFault, model: Model, log: Log, how: Preprocessing, error: float
) -> Iterator[tuple[ColumnFault, Observations, Model]]:
    """Yield faults of joints, legs and gravity with a fit far better than `error`."""

    def trials() -> Iterator[tuple[list[ColumnFault], Observations, Model]]:
        """Yield faults, the observations to which they apply, and their model."""
        for fault, observations in _joint_corrections(unchanged, model, log, how):
            yield _with_signs(fault, {unchanged.order, fault.joint_order}), observations, model
        if any(model.robot.gravity):
            x, y, z = model.robot.gravity
            turned = replace(model.robot, gravity=(-x, -y, -z))
            other = replace(model, base=replace(model.base, robot=turned))
            faults = _with_signs(replace(unchanged, gravity=True), [unchanged.order])
            yield faults, observations_of(other, log, how), other

    for faults, observations, other in trials():
        for candidate in _with_errors(observations, faults):
            if candidate.after * DECISIVE < error:
                yield candidate, observations, other


def _joint_corrections(
    unchanged: ColumnFault, model: LinearModel, log: Log, how: Preprocessing
) -> Iterator[tuple[ColumnFault, Observations]]:
    """Yield each flipped sign or other order of joints that has poses, and observations."""
    n = len(unchanged.order)
    flips = (1 - 2 * np.eye(n, dtype=int)).tolist()
    faults = [replace(unchanged, joint_signs=tuple(signs)) for signs in flips]
    faults += [replace(unchanged, joint_order=order) for order in _orders(n)]
    for fault in faults:
        joints = log.joints[:, list(fault.joint_order)] * np.array(fault.joint_signs)
        try:
            yield fault, observations_of(model, replace(log, joints=joints), how)
        except DataError:
            continue  # no poses in this order


def _orders(n: int) -> list[tuple[int, ...]]:
    """Return the orders of n joints that are tried, those of fewest exchanges first.

    Of two orders that explain equally well, the simpler one is right. Of many joints not all 719 or
    more are tried, each with poses of its own, but exchanges of two, of all neighbours in pairs,
    shifts and the reverse.
    """
    usual = tuple(range(n))
    if n <= _ALL_ORDERS:
        return sorted(permutations(usual), key=_exchanges)[1:]
    shifts = [usual[k:] + usual[:k] for k in range(1, n)]
    pairs = [tuple({i: j, j: i}.get(k, k) for k in usual) for i, j in combinations(usual, 2)]
    couples = [(i, (i + 1) % n) for i in usual[: n - n % 2]]
    neighbours = [
        tuple(dict((*some, *((j, i) for i, j in some))).get(k, k) for k in usual)
        for some in (couples[::2], couples[1::2])
    ]
    return [*pairs, *neighbours, *shifts, usual[::-1]]


def _with_errors(observations: Observations, faults: Sequence[ColumnFault]) -> list[ColumnFault]:
    """Return the faults with the error of their fits, relative to the forces, in `after`."""
    step = max(len(observations.forces) // _ROWS, 1)
    matrix, forces = observations.matrix[::step], observations.forces[::step]
    rows, n, p = matrix.shape
    basis = np.linalg.qr(scale_columns(matrix.reshape(-1, p))[0])[0].reshape(rows, n, -1)
    # The projection of each column, given to each actuator: orders and signs add these up.
    parts = np.einsum("rnk,rj->njk", basis, forces)
    power = float((forces**2).sum())
    with_errors = []
    for fault in faults:
        image = np.array(fault.signs) @ parts[np.arange(n), list(fault.order)]
        error = float(np.sqrt(max(power - float(image @ image), 0.0) / power))
        with_errors.append(replace(fault, after=error))
    return with_errors


def _count_unphysical(fault: ColumnFault, observations: Observations, model: Model) -> int:
    """Return the number of unphysical values that the corrected forces give."""
    forces = observations.forces[:, list(fault.order)] * np.array(fault.signs)
    mended = observations.with_forces(forces)
    return unphysical(model, mended, weighted_least_squares(mended))
