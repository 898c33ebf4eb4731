"""`base_parameters`: finds the sums of inertial parameters that alone act on the drives' forces.

`base_regressor` is the matrix whose product with them is the forces.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from importlib.metadata import version
from typing import Literal, get_args

from pteron.arguments import expect_one_of
from pteron.bodies.parameters import Parameter
from pteron.errors import ModelError
from pteron.kernels import OTHER_LAYOUT, geometry_only, same_layout
from pteron.kernels.program_cache import cached_result
from pteron.kinematics.evaluate import evaluate_kernel
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.reduction.exact import exact_grouping
from pteron.reduction.grouping import Grouping
from pteron.reduction.numerical import qr_grouping, svd_grouping
from pteron.reduction.result import BaseParameters
from pteron.reduction.sharing import Sharing, default_order, leg_groups, share
from pteron.reduction.transfers import transfers
from pteron.shapes import OnFailure, PoseLike, Regressors, Seed, seed_number

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
    expect_one_of(get_args(Method), ModelError, method=method)
    groups = tuple(leg_groups(robot, shared))
    columns, sharing = share(robot, groups)
    order = _order(columns, keep)
    # Neither bodies nor drives matter; a refusal tells the name.
    layout = replace(geometry_only(robot), name=robot.name)
    grouping = _grouping(layout, method, tuple(order), groups, seed_number(seed))
    names = [column.name for column in columns]
    lost = [name for name in keep or () if names.index(name) not in grouping.kept]
    if lost:
        raise ModelError(
            f"keep: {', '.join(lost)} cannot be kept: zero, or dependent on the columns named "
            "before; leave it out"
        )
    return BaseParameters.from_grouping(robot, columns, sharing, grouping)


@lru_cache(maxsize=256)
def _grouping(
    layout: Manipulator, method: Method, order: tuple[int, ...], groups: Groups, seed: int
) -> Grouping:
    """Return the grouping of a machine's columns, in an order of preference."""

    def compute_grouping() -> Grouping:
        """Return the grouping of the columns by the method."""
        columns, sharing = share(layout, groups)
        if method == "exact":
            by_mass = transfers(layout, columns)
            return exact_grouping(layout, columns, order, sharing, by_mass, seed)
        return _NUMERICAL[method](layout, order, sharing, seed)

    key = "grouping", layout, method, order, groups, seed, version("sympy")
    return cached_result(key, ("kinematics", "reduction"), compute_grouping)


def _order(columns: Sequence[Parameter], keep: Sequence[str] | None) -> list[int]:
    """Return the columns in order of preference, those of `keep` in front."""
    default = default_order(columns)
    if keep is None:
        return default
    names = [column.name for column in columns]
    unknown = [name for name in keep if name not in names]
    if isinstance(keep, str) or unknown:
        wrong = keep if isinstance(keep, str) else unknown[0]
        raise ModelError(
            f"keep: {wrong!r} is no list of parameter names; they are {', '.join(names)}"
        )
    first = [names.index(name) for name in dict.fromkeys(keep)]
    return first + [column for column in default if column not in first]  # Section 5 (b)


def base_regressor(
    robot: RobotLike,
    base: BaseParameters,
    pose: PoseLike,
    velocity: PoseLike,
    acceleration: PoseLike,
    *,
    on_failure: OnFailure = "raise",
) -> Regressors:
    """Return the reduced dynamic matrix: base_regressor @ base.values(robot) = inverse_dynamics.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    base : BaseParameters
        Its base parameters, from `base_parameters`.
    pose, velocity, acceleration : array, shape (..., m)
        The platform's motion; m, rad and s. Leading axes broadcast.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    array, shape (..., n, rank)
        N or N m per unit of each base parameter.

    Raises
    ------
    ModelError
        If `base` belongs to a machine of another layout, or with other gravity.
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I), or the actuators do not hold the platform
        (type II).

    Examples
    --------
    >>> import numpy as np, pteron
    >>> robot = pteron.load("quadrupteron")
    >>> base = pteron.base_parameters(robot)
    >>> state = [0.01, 0.02, 0.03, 0.1], [0.1, 0.0, 0.2, 1.0], [1.0, 2.0, 0.0, 3.0]
    >>> forces = pteron.base_regressor(robot, base, *state) @ base.values(robot)
    >>> np.allclose(forces, pteron.inverse_dynamics(robot, *state))
    True
    """
    robot = as_manipulator(robot)
    if base.robot is not robot and not same_layout(base.robot, robot):
        raise ModelError(OTHER_LAYOUT.format(base.robot.name, robot.name))
    motion = pose, velocity, acceleration
    matrices: Regressors = evaluate_kernel(robot, "base_regressor", on_failure, *motion, base=base)
    return matrices  # Section 5 (c), Contribution 3
