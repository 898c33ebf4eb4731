"""Entries of the table of functions that can be compiled: inputs, equations, conditions.

For each function: its inputs, its outputs as CasADi expressions, and the conditions on the pose
under which its result is valid. `pose_functions` and `functions` fill the table.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from pteron.bodies.motion import Expression
from pteron.equations.machine import Machine

Output = Expression | list[Expression] | tuple[Expression, tuple[int, ...]]
"""An expression, of which a column becomes a vector; a list of expressions to be stacked; or an
expression with the shape it is to have."""

Outputs = dict[str, Output]
"""Outputs by name, in order."""

Need = Literal["rows", "reach", "type I", "angles", "type II"]
"""A condition on the pose: in reach, not singular of type I, of type II; "rows" is the first two
conditions on the legs whose row [dq/dc | dq/dphi] depends on the pose; "angles" means nonsingular
angles of the platform."""

TYPE_I = 1e-4
"""Least type-I measure of a leg (0 where it is singular) where a result is divided by it: the
relative error is 1e-15 to 1e-14 over the measure's square, so that six digits are left here."""

TYPE_II = 1e-9
"""Least type-II measure of the machine where a result needs J^-1: six digits are left here."""

ANGLES = 1e-9
"""Least measure of the platform's angles where a result is the rate of one: six digits are left."""


@dataclass(frozen=True)
class Inputs:
    """The expressions of an entry's inputs, or what a caller puts for them; None: not an input.

    Those of the machine's state are columns: (n,) of the joints, (m,) of the pose.
    """

    pose: Expression = None
    velocity: Expression = None
    acceleration: Expression = None
    forces: Expression = None
    wrench: Expression = None
    """Wrench on the platform (w,)."""
    twist: Expression = None
    joints: Expression = None
    joint_rates: Expression = None
    joint_accelerations: Expression = None
    parameters: Expression = None
    """The inertial parameters (K,), or their rows (K, k) in the base parameters."""
    base_parameters: Expression = None
    """The base parameters (k,), of which `parameters` are a function."""
    selection: Expression = None
    """Matrix (K, k) from base parameters to inertial parameters."""
    carried: bool = True
    """Whether a rod's mass on a platform point is the platform's instead of the leg's."""
    drives: Expression = None
    actuators: Expression = None
    kind: Any = None
    """`DriveKind`, the features of the drives."""
    gains: Expression = None
    memory: Expression = None
    mass: Expression = None
    center: Expression = None
    inertia: Expression = None
    pivot: Expression = None
    """A point of the platform, in its frame (3,)."""
    side: Expression = None
    """Directions in which the joints slide (n,): -1, 1, or 0 where they stick."""
    hold: Expression = None
    brake: Expression = None
    pace: Expression = None
    motor: Expression = None
    motor_rate: Expression = None
    current: Expression = None
    bristle: Expression = None


_Build = Callable[[Machine, Inputs], Outputs]


@dataclass(frozen=True)
class Entry:
    """A function: its inputs by name, the equations of its outputs, its conditions on the pose."""

    inputs: tuple[str, ...]
    build: _Build
    needs: tuple[Need, ...] = ()
    """Conditions on the pose for a valid result, in the order of the messages."""


POSE, RATE = ("pose",), ("pose", "velocity")
MOTION = ("pose", "velocity", "acceleration")
NEEDS_REACH: tuple[Need, ...] = ("reach",)
NEEDS_CONSTANT_ROWS: tuple[Need, ...] = ("rows",)
NEEDS_TYPE_I: tuple[Need, ...] = ("reach", "type I")
NEEDS_TYPE_II: tuple[Need, ...] = ("reach", "type I", "type II")
NEEDS_ANGLES: tuple[Need, ...] = (*NEEDS_TYPE_I, "angles")

TABLE: dict[str, Entry] = {}
"""All functions by name."""


def equation_entry(
    equation: Callable[..., Any],
    inputs: tuple[str, ...],
    outputs: str,
    needs: tuple[Need, ...] = (),
) -> Entry:
    """Return the table entry of a function `equation(machine, *inputs)` with named outputs.

    `outputs` are the names of its results, separated by blanks.
    """
    return _entry_of(
        lambda m, v: equation(m, *(getattr(v, name) for name in inputs)), inputs, outputs, needs
    )


def state_entry(
    equation: Callable[[Any], Any],
    inputs: tuple[str, ...],
    outputs: str,
    needs: tuple[Need, ...] = (),
) -> Entry:
    """Return the table entry of a function `equation(state)` with named outputs."""
    return _entry_of(lambda m, v: equation(state(m, v)), inputs, outputs, needs)


def _entry_of(build: Any, inputs: tuple[str, ...], outputs: str, needs: tuple[Need, ...]) -> Entry:
    """Return the table entry of a function whose outputs are named in a text."""
    names = outputs.split()

    def build_outputs(m: Machine, v: Inputs) -> Outputs:
        """Return the results of `build` by output name."""
        results = build(m, v)
        return dict(zip(names, results if len(names) > 1 else [results], strict=True))

    return Entry(inputs, build_outputs, needs)


def state(m: Machine, v: Inputs) -> Any:
    """Return the machine's motion state for the given pose, velocity and acceleration symbols."""
    return m.state(v.pose, v.velocity, v.acceleration)


def as_vector(column: Expression) -> tuple[Expression, tuple[int, ...]]:
    """Return a column with its shape (k,), also for a single element or none."""
    return column, column.shape[:1]
