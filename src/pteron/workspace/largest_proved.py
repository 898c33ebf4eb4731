"""The largest region of a family that is proved to lie in the workspace.

Its size is found by samples of its poses, and then made smaller until a proof holds.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable

from pteron.kernels import Array
from pteron.kernels.bisection import bisect_condition
from pteron.manipulator import Manipulator
from pteron.workspace.conditions import Condition, keeps
from pteron.workspace.proofs import Proof, prove
from pteron.workspace.regions import Region


def largest_proved(
    robot: Manipulator,
    required: tuple[Condition, ...],
    region: Callable[[float], Region],
    poses: Callable[[float], Array],
    most: float,
    halvings: int,
    shares: Iterable[float],
    report: Callable[[float], None] = lambda share: None,
) -> tuple[float, Proof]:
    """Return the size of the largest region proved to keep conditions, with its proof.

    `region` and `poses` return the region of a size and poses (K, m) of it. The size is sought up
    to `most` by bisection, and the proof with these shares of it, the largest first. The proof does
    not hold where none does. `report` is called with the share of the work that is done: half of it
    is the bisection.
    """
    halved = itertools.count(1)

    def keeps_all(size: float) -> bool:
        """Return whether all sample poses at a size keep the conditions; report progress."""
        report(0.5 * next(halved) / halvings)
        return bool(keeps(robot, required, poses(size)).all())

    size = float(bisect_condition(keeps_all, 0.0, most, halvings)[0])
    for share in shares:
        proof = prove(
            robot,
            region(share * size),
            given=required,
            progress=lambda decided: report(0.5 + 0.5 * decided),
        )
        if proof.holds:
            break
    return share * size, proof
