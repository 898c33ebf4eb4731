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
    """Columns of forces, or of joints, that are not what they are called.

    Attributes
    ----------
    names : tuple of str
        What the columns are called: force1 ..., or rho1 ..., at cranks torque1 ... and theta1 ... .
    order : tuple of int
        Which of them, from 0, belongs to each actuator.
    signs : tuple of int
        1, or -1 for a column whose sign is flipped.
    before, after : float
        Error of the fit relative to the forces, as it is and when mended.
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
        moved = [k for k in range(n) if self.order[k] != k]
        if moved:
            names = _listed([self.names[k] for k in moved])
            verb = "are swapped" if len(moved) == 2 else "are in another order"
            parts.append(f"{names} {verb}")
            if len(moved) > 2:
                order = ", ".join(self.names[k] for k in self.order)
                parts[-1] += f" (they should be {order})"
        if len(flipped) == n:
            parts.append("the forces, or all joints, have the sign flipped")
        elif flipped:
            names = _listed([self.names[self.order[k]] for k in flipped])
            parts.append(f"{names} {'has' if len(flipped) == 1 else 'have'} the sign flipped")
        return " and ".join(parts)


def column_fault(model: Model, log: Log, preprocessing: Preprocessing) -> Fault | None:
    """Return the exchange of columns, or of signs, that explains a log's forces far better.

    All n! 2^n orders and signs of the forces are tried, all orders of the joints, and their signs
    one by one. Signs of all forces at once are settled by the machine's inertia, which is positive.
    None where nothing makes the error three times smaller, or the inertia positive.
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
    order, sign = choices[best] if errors[best] * _DECISIVE < before else choices[0]
    after = min(errors[best], before) if (order, sign) != choices[0] else before
    swapped = exchanged_joints(model, log, plain, before)
    # Exchanged forces can do some of what exchanged joints do.
    if swapped is not None and swapped.after < 0.7 * after:
        return swapped
    mended = observations.with_forces(observations.forces[:, list(order)] * np.array(sign))
    # Where nothing explains the forces, the sign of what is left says nothing.
    if after < _EXPLAINED and has_negative_inertia(model, weighted(mended).values):
        sign = tuple(-s for s in sign)
    if (order, sign) == choices[0]:
        return None
    names = tuple(f"{leg.joint.force}{i}" for i, leg in enumerate(model.robot.legs, start=1))
    return Fault(names, tuple(order), sign, before, after)


def _errors(observations: Observations, choices: Sequence[_Choice]) -> list[float]:
    """Return the error of the fit relative to the forces, for each order and signs of these.

    One factorisation serves all: the error is what the projection on the columns leaves.
    """
    step = max(len(observations.forces) // _ROWS, 1)
    matrix, forces = observations.matrix[::step], observations.forces[::step]
    flat = matrix.reshape(-1, matrix.shape[-1])
    lengths = np.linalg.norm(flat, axis=0)
    basis = np.linalg.qr(flat / np.where(lengths > 0.0, lengths, 1.0))[0]
    found = []
    for order, signs in choices:
        given = (forces[:, list(order)] * np.array(signs)).ravel()
        image = basis.T @ given
        power = float(given @ given)
        found.append(float(np.sqrt(max(power - float(image @ image), 0.0) / power)))
    return found


def exchanged_joints(
    model: Model, log: Log, preprocessing: Preprocessing, before: float
) -> Fault | None:
    """Return the order of the joints, or the sign of one, that explains the forces far better.

    `before` is the error of the fit relative to the forces as they are.
    """
    n = log.joints.shape[1]
    best: Fault | None = None
    names = tuple(f"{leg.joint.coordinate}{i}" for i, leg in enumerate(model.robot.legs, start=1))
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
            best = Fault(names, order, signs, before, error)
    return best


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
