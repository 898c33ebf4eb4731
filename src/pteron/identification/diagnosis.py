"""What is wrong with a log whose forces a model cannot explain: flipped signs, swapped columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np

from pteron.errors import DataError
from pteron.identification.estimators import weighted
from pteron.identification.logs import Log
from pteron.identification.model import Model
from pteron.identification.observation import Observations, observations_of
from pteron.identification.plausibility import has_negative_inertia
from pteron.identification.signals import Preprocessing

_DECISIVE = 3.0
"""Factor by which the error must fall for a fault to be called found."""

_EXPLAINED = 0.3
"""Error relative to the forces below which a fit explains them."""

_ROWS = 4000

_Choice = tuple[tuple[int, ...], tuple[int, ...]]
"""An order of the columns, and their signs."""


@dataclass(frozen=True)
class Fault:
    """Columns of forces, or of joints, that are not what their `names` say.

    `order` is which of them, from 0, belongs to each actuator, a sign is -1 where it is flipped;
    `before` and `after` mending they leave such errors of the fit relative to the forces.
    """

    names: tuple[str, ...]
    order: tuple[int, ...]
    signs: tuple[int, ...]
    before: float
    after: float

    def message(self) -> str:
        """Return what is wrong and what to do, as part of a sentence."""
        parts = []
        n = len(self.order)
        flipped = [k for k in range(n) if self.signs[k] < 0]
        moved = [name for k, name in enumerate(self.names) if self.order[k] != k]
        if len(moved) == 2:
            parts.append(f"{_listed(moved)} are swapped")
        elif moved:
            order = ", ".join(self.names[k] for k in self.order)
            parts.append(f"{_listed(moved)} are in another order (they should be {order})")
        if len(flipped) == n:
            parts.append("the forces, or all joints, have the sign flipped")
        elif flipped:
            names = _listed([self.names[self.order[k]] for k in flipped])
            parts.append(f"{names} {'has' if len(flipped) == 1 else 'have'} the sign flipped")
        return " and ".join(parts)


def column_fault(model: Model, log: Log, preprocessing: Preprocessing) -> Fault | None:
    """Return the exchange of columns, or of signs, that explains a log's forces far better.

    None where nothing makes the error three times smaller, or the machine's inertia positive.
    """
    # Without the mask of slow joints, which belongs to the order that is in question.
    plain = replace(preprocessing, slow=np.zeros_like(preprocessing.slow))
    observations = observations_of(model, log, plain)
    n = observations.actuators
    # A choice of signs and its opposite fit alike.
    signs = [(1, *rest) for rest in product((1, -1), repeat=n - 1)]
    choices = [(order, sign) for order in permutations(range(n)) for sign in signs]
    errors = _errors(observations, choices)
    before = errors[0]
    best = int(np.argmin(errors))
    if not errors[best] * _DECISIVE < before:
        best = 0
    (order, sign), after = choices[best], errors[best]
    swapped = exchanged_joints(model, log, plain, before)
    # Exchanged forces can do some of what exchanged joints do.
    if swapped is not None and swapped.after < 0.7 * after:
        return swapped
    mended = observations.with_forces(observations.forces[:, list(order)] * np.array(sign))
    # Where nothing explains the forces, the sign of what is left says nothing.
    found = weighted(mended)
    if after < _EXPLAINED and has_negative_inertia(model, found.values, found.covariance):
        sign = tuple(-s for s in sign)
    if (order, sign) == choices[0]:
        return None
    return Fault(model.robot.force_names, order, sign, before, after)


def _errors(observations: Observations, choices: Sequence[_Choice]) -> list[float]:
    """Return the error of the fit relative to the forces, for each order and signs of these."""
    step = max(len(observations.forces) // _ROWS, 1)
    matrix, forces = observations.matrix[::step], observations.forces[::step]
    flat = matrix.reshape(-1, matrix.shape[-1])
    lengths = np.linalg.norm(flat, axis=0)
    basis = np.linalg.qr(flat / np.where(lengths > 0.0, lengths, 1.0))[0]
    found = []
    # One factorisation serves all: the error is what the projection on the columns leaves.
    for order, signs in choices:
        given = (forces[:, list(order)] * np.array(signs)).ravel()
        image = basis.T @ given
        power = float(given @ given)
        found.append(float(np.sqrt(max(power - float(image @ image), 0.0) / power)))
    return found


def exchanged_joints(
    model: Model, log: Log, preprocessing: Preprocessing, before: float
) -> Fault | None:
    """Return the order of the joints, or the sign of one, that makes the error `before` small."""
    n = log.joints.shape[1]
    best: Fault | None = None
    usual, upright = tuple(range(n)), (1,) * n
    choices = [(usual, tuple(-1 if k == i else 1 for k in range(n))) for i in range(n)]
    # Few exchanges first: of two orders that do as well, the simpler one is meant.
    orders = sorted(permutations(range(n)), key=lambda order: sum(map(int.__ne__, order, usual)))
    choices += [(order, upright) for order in orders[1:]]
    for order, signs in choices:
        other = replace(log, joints=log.joints[:, list(order)] * np.array(signs))
        try:
            observations = observations_of(model, other, preprocessing)
        except DataError:
            continue  # no poses in this order
        (error,) = _errors(observations, [(usual, upright)])
        if error * _DECISIVE < (before if best is None else best.after * _DECISIVE):
            best = Fault(model.robot.joint_names, order, signs, before, error)
    return best


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
