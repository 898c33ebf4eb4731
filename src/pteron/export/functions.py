"""What is exported: functions by name, with their numbers, what they mean, and examples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pteron.errors import ModelError
from pteron.export.labels import Labelled, labelled
from pteron.kernels import FUNCTIONS as COMPILED
from pteron.kernels import Array, Port, compile, program, specialised
from pteron.kinematics import inverse_kinematics, random_poses
from pteron.manipulator import Manipulator, parameter_names, parameters
from pteron.reduction import BaseParameters, cheapest_parameters

__all__ = ["FUNCTIONS", "Exported", "Table", "chosen"]

FUNCTIONS = (
    "inverse_kinematics",
    "direct_kinematics",
    "jacobian",
    "inverse_dynamics",
    "inverse_dynamics_base",
    "forward_dynamics",
    "regressor",
)
"""What is exported unless a choice is given."""

_SUMMARIES = {
    "inverse_kinematics": "Slider coordinates of a pose.",
    "direct_kinematics": "Every pose that slider coordinates allow, one a row.",
    "jacobian": "Jacobian: slider velocities = J velocity.",
    "inverse_dynamics": "Actuator forces of a motion, from the inertial parameters.",
    "inverse_dynamics_base": "Actuator forces of a motion, from base parameters: fewest operations.",
    "forward_dynamics": "Acceleration of the platform under actuator forces.",
    "regressor": "Regressor: actuator forces = regressor parameters.",
}


@dataclass(frozen=True)
class Table:
    """Numbers of the machine that functions take as an argument."""

    name: str
    comment: str
    names: tuple[str, ...]
    values: Array


@dataclass(frozen=True)
class Exported:
    """One function: its graph with names, its ports, and states with their results."""

    name: str
    summary: str
    labelled: Labelled
    outputs: tuple[Port, ...]
    tables: tuple[Table, ...]
    examples: tuple[tuple[tuple[Array, ...], tuple[Array, ...]], ...]

    @property
    def operations(self) -> int:
        """Arithmetic operations."""
        return len(self.labelled.graph.operations())


def chosen(
    robot: Manipulator, functions: Sequence[str], *, specialised: bool
) -> tuple[Exported, ...]:
    """Return what is to be written.

    Raises
    ------
    ModelError
        If a name is unknown, or there is none.
    """
    names = [functions] if isinstance(functions, str) else list(dict.fromkeys(functions))
    allowed = sorted({*COMPILED, "inverse_dynamics_base"} - {"base_regressor"})
    for name in names:
        if name not in allowed:
            raise ModelError(
                f"functions: {name!r} cannot be exported; choose from {', '.join(allowed)}"
            )
    if not names:
        raise ModelError(f"functions: none given; choose from {', '.join(allowed)}")
    return tuple(_exported(robot, name, folded=specialised) for name in names)


def _exported(robot: Manipulator, name: str, *, folded: bool) -> Exported:
    base: BaseParameters | None = None
    what = name
    if name == "inverse_dynamics_base":
        what, base = "inverse_dynamics", cheapest_parameters(robot)
    kernel = compile(robot, what, base=base, grade="parametric")
    columns = None
    if base is not None:
        columns = tuple(tuple(np.flatnonzero(column).tolist()) for column in base.selection.T)
    given = program(robot, what, columns)
    tables: tuple[Table, ...] = ()
    if kernel.fixed and folded:
        given = specialised(given, kernel.fixed)
    elif kernel.fixed:
        ((port, values),) = kernel.fixed.items()
        tables = (_table(robot, port, values, base),)
    # Argument names must differ from those of the results.
    taken = {port.name for port in given.inputs}
    outputs = tuple(
        replace(port, name=f"{port.name}_out" if port.name in taken else port.name)
        for port in given.outputs
    )
    found = labelled(robot, given)
    return Exported(
        name,
        _SUMMARIES.get(name, f"{what.replace('_', ' ')}, as pteron.{what}.".capitalize()),
        found,
        outputs,
        tables,
        tuple(_examples(robot, found)),
    )


def _table(robot: Manipulator, port: str, values: Array, base: BaseParameters | None) -> Table:
    if base is None:
        comment = "The machine's inertial parameters, in the paper's order; SI units."
        return Table(port, comment, parameter_names(robot), values)
    comment = (
        "Base parameters of the machine as inverse_dynamics_base takes them: each a base parameter "
        "scaled by lengths and gravity."
    )
    names = tuple(f"number {k + 1}" for k in range(len(values)))
    expressions = _meanings(robot, base, values)
    return Table(port, comment, expressions or names, values)


def _meanings(robot: Manipulator, base: BaseParameters, values: Array) -> tuple[str, ...]:
    """Return each scaled base parameter as a sum of inertial parameters, as text."""
    columns = tuple(tuple(np.flatnonzero(column).tolist()) for column in base.selection.T)
    scale = program(robot, "inverse_dynamics", columns).scale
    if scale is None:
        return base.expressions()
    total = np.array(scale) @ base.grouping
    names = parameter_names(robot)
    meanings = []
    for row in total:
        largest = np.abs(row).max()
        terms = [
            f"{weight:+.6g} {name}"
            for weight, name in zip(row, names, strict=True)
            if abs(weight) > 1e-12 * largest
        ]
        meanings.append(" ".join(terms))
    assert len(meanings) == len(values)
    return tuple(meanings)


def _examples(
    robot: Manipulator, found: Labelled
) -> list[tuple[tuple[Array, ...], tuple[Array, ...]]]:
    """Return states and results for the test program: two in reach, one out of it."""
    given = found.program
    rng = np.random.default_rng(1)
    poses = list(random_poses(robot, 2, seed=rng))
    far = poses[0].copy()
    far[:3] += 100.0
    examples = []
    for k, pose in enumerate([*poses, far]):
        values = []
        for port in given.inputs:
            if port.name == "pose":
                values.append(pose)
            elif port.name == "sliders":
                sliders = inverse_kinematics(robot, poses[k % 2])
                values.append(sliders + (0.0 if k < 2 else 100.0 * np.arange(1, len(sliders) + 1)))
            elif port.name == "parameters":
                values.append(parameters(robot))
            elif port.name == "base_parameters":
                kernel = compile(
                    robot, "inverse_dynamics", base=cheapest_parameters(robot), grade="parametric"
                )
                values.append(kernel.fixed["base_parameters"])
            else:
                values.append(rng.normal(size=port.shape))
        results = tuple(
            np.array(value).ravel("F") for value in given.function.call([*map(_column, values)])
        )
        whole = all(np.isfinite(value).all() for value in results)
        if whole or k == 2:
            examples.append((tuple(values), results))
    return examples


def _column(value: Array) -> Array:
    return np.asarray(value, dtype=float).reshape(-1, 1)
