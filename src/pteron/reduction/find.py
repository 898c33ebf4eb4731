"""`base_parameters`: finds the sums of inertial parameters that alone act on the drives' forces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Literal, get_args

from pteron.bodies.parameters import Parameter
from pteron.errors import ModelError
from pteron.kernels import bare
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.reduction.exact import exact_grouping
from pteron.reduction.grouping import Grouping
from pteron.reduction.numerical import qr_grouping, svd_grouping
from pteron.reduction.result import BaseParameters
from pteron.reduction.sharing import Sharing, default_order, leg_groups, share
from pteron.reduction.transfers import transfers
from pteron.shapes import Seed

Method = Literal["exact", "svd", "qr"]

Groups = tuple[tuple[int, ...], ...]
"""Legs, from 1, in groups that share their parameters."""

_NUMERICAL: dict[str, Callable[..., Grouping]] = {"svd": svd_grouping, "qr": qr_grouping}


def base_parameters(
    robot: RobotLike,
    method: Method = "exact",
    keep: Sequence[str] | None = None,
    *,
    shared: Sharing = False,
    seed: Seed = 0,
) -> BaseParameters:
    """Return the base inertial parameters of a machine.

    The regressor's columns are dependent, so that only sums of parameters act on the forces. Any
    invertible combination of a base set is a base set; here some columns are kept, and the others
    join them.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine; geometry and gravity matter, its inertial parameters do not.
    method : {"exact", "svd", "qr"}
        Exact arithmetic with a certificate (the default), or the two numerical methods of the
        literature at random states, which confirm it.
    keep : sequence of str, optional
        Columns to keep before others. By default the choice of the paper's Table 1: m_u, I_l, m_l
        of the last leg, and the platform's first moments and moment of inertia join others.
    shared : bool or groups of legs
        Whether legs share one parameter set: True for all, or groups such as ``[(2, 4)]``.
    seed : int
        Of the random states.

    Returns
    -------
    BaseParameters
        With `rank`, `names`, `grouping`, `expressions()`, `values()` and `certificate`.

    Raises
    ------
    ModelError
        If a name in `keep` is unknown, or depends on those before it.
    SingularPose
        If the machine is singular at every pose.

    Notes
    -----
    The guide points do matter to `exact` as well: the rank is that of this machine, at poses of its
    own. Floats are made exact first; the certificate says which were taken for roots, such as
    sqrt(3)/2, which were approximated, and by how much.

    Examples
    --------
    >>> import pteron
    >>> base = pteron.base_parameters(pteron.load("quadrupteron"))
    >>> base.rank, base.expressions()[0]
    (26, 'm_p1 + m_u1 + 20.11 I_l1')
    >>> base.expressions(symbols=True)[0]
    'm_p1 + m_u1 + (1/ll1^2) I_l1'
    """
    robot = as_manipulator(robot)
    if method not in get_args(Method):
        raise ModelError(f"method: {method!r} is not one of {', '.join(get_args(Method))}")
    groups = tuple(leg_groups(robot, shared))
    columns, sharing = share(robot, groups)
    order = _order(columns, keep)
    by_mass = transfers(robot, columns)
    # Neither bodies nor drives matter; a refusal tells the name.
    layout = replace(bare(robot), name=robot.name)
    grouping = _grouping(layout, method, tuple(order), groups, seed)
    names = [column.name for column in columns]
    lost = [name for name in keep or () if names.index(name) not in grouping.kept]
    if lost:
        raise ModelError(
            f"keep: {', '.join(lost)} cannot be kept: zero, or dependent on the columns named "
            "before; leave it out"
        )
    return BaseParameters.of(robot, columns, sharing, tuple(by_mass), grouping)


@lru_cache(maxsize=256)
def _grouping(
    layout: Manipulator, method: Method, order: tuple[int, ...], groups: Groups, seed: int
) -> Grouping:
    """Return the grouping of a machine's columns, in an order of preference."""
    columns, sharing = share(layout, groups)
    if method == "exact":
        by_mass = transfers(layout, columns)
        return exact_grouping(layout, columns, order, sharing, by_mass, seed)
    return _NUMERICAL[method](layout, order, sharing, seed)


def _order(columns: Sequence[Parameter], keep: Sequence[str] | None) -> list[int]:
    """Return the columns in order of preference, those of `keep` in front."""
    default = default_order(columns)
    if keep is None:
        return default
    names = [column.name for column in columns]
    unknown = [name for name in keep if name not in names]
    if isinstance(keep, str) or unknown:
        given = keep if isinstance(keep, str) else unknown[0]
        raise ModelError(
            f"keep: {given!r} is no list of parameter names; they are {', '.join(names)}"
        )
    first = [names.index(name) for name in dict.fromkeys(keep)]
    return first + [column for column in default if column not in first]
