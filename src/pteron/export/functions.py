"""What is exported: functions by name, with their numbers, what they mean, and examples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pteron.errors import ModelError
from pteron.export.labels import Labelled, labelled
from pteron.kernels import FUNCTIONS as COMPILED
from pteron.kernels import Array, Port, columns_of, compile, program, specialised
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

_TRIALS = 40
"""Poses among which examples for the test program are looked for."""

_SUMMARIES = {
    "inverse_kinematics": "Slider coordinates of a pose.",
    "direct_kinematics": "Every pose that slider coordinates allow, one a row; NaN where none.",
    "closure_poses": "Every pose that solves the closures, one a row, in the legs' reach or not.",
    "jacobian": "Jacobian: slider velocities = J velocity. It does not ask whether the legs reach.",
    "inverse_dynamics": "Actuator forces of a motion, from the inertial parameters.",
    "inverse_dynamics_base": "Actuator forces of a motion, from base parameters alone.",
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
    def several(self) -> bool:
        """Whether it returns a pose a row, of which some may not exist."""
        return self.name == "direct_kinematics"

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
    given = program(robot, what, None if base is None else columns_of(base))
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
    comment = "What inverse_dynamics_base takes: base parameters, scaled by lengths and gravity."
    return Table(port, comment, _meanings(robot, base), values)


def _meanings(robot: Manipulator, base: BaseParameters) -> tuple[str, ...]:
    """Return each scaled base parameter as a sum of inertial parameters, as text."""
    scale = program(robot, "inverse_dynamics", columns_of(base)).scale
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
    return tuple(meanings)


def _examples(
    robot: Manipulator, found: Labelled
) -> list[tuple[tuple[Array, ...], tuple[Array, ...]]]:
    """Return states and results for the test program: two in reach, one out of it."""
    rng = np.random.default_rng(1)
    poses = random_poses(robot, _TRIALS, seed=rng)
    examples: list[tuple[tuple[Array, ...], tuple[Array, ...]]] = []
    for pose in poses:
        example = _evaluated(
            found, [_value(robot, port, pose, rng) for port in found.program.inputs]
        )
        # Of two assembly modes one may be out of reach: such a result is not a number throughout.
        if all(np.isfinite(value).all() for value in example[1]):
            examples.append(example)
        if len(examples) == 2:
            break
    inputs = [_value(robot, port, poses[0], rng) for port in found.program.inputs]
    for value, port in zip(inputs, found.program.inputs, strict=True):
        if port.name in ("pose", "sliders"):
            value += 100.0 * np.arange(1, len(value) + 1)
    return [*examples, _evaluated(found, inputs)]


def _value(robot: Manipulator, port: Port, pose: Array, rng: np.random.Generator) -> Array:
    if port.name == "pose":
        return pose.copy()
    if port.name == "sliders":
        return np.array(inverse_kinematics(robot, pose))
    if port.name == "parameters":
        return parameters(robot)
    if port.name == "base_parameters":
        base = cheapest_parameters(robot)
        kernel = compile(robot, "inverse_dynamics", base=base, grade="parametric")
        return np.array(kernel.fixed["base_parameters"])
    return rng.normal(size=port.shape)


def _evaluated(found: Labelled, inputs: list[Array]) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    results = found.program.function.call([*map(_column, inputs)])
    return tuple(inputs), tuple(np.array(value).ravel("F") for value in results)


def _column(value: Array) -> Array:
    return np.asarray(value, dtype=float).reshape(-1, 1)
