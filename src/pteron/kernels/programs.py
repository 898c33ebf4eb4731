"""CasADi functions ("programs") of a machine's kinematics and dynamics, each found by its name.

A program depends on the machine's geometry and gravity alone: inertial parameters and drives are
inputs, so that machines of one geometry share it (in a `general_program` geometry and gravity are
an input too). On request a last output, `status`, is 1 where the result is valid and 0 where not;
in exported code it is the other way round, 0 where it is valid.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from functools import lru_cache, partial
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from pteron.bodies.inertia import inertia_count
from pteron.bodies.motion import Expression
from pteron.equations import control, kinematics
from pteron.equations.drives import Drives
from pteron.equations.machine import Machine
from pteron.equations.topology import stored_numbers, topology_of, with_stored_numbers
from pteron.equations.transmissions import DriveKind, actuator_count
from pteron.errors import ModelError
from pteron.kernels.functions import (
    ANGLES,
    FUNCTIONS,
    INTERNAL,
    TABLE,
    TYPE_I,
    TYPE_II,
    Entry,
    Inputs,
    Output,
)
from pteron.kernels.kernel import Port, count_operations
from pteron.kernels.passes import optimise_function
from pteron.kernels.program_cache import Program, cached_program, shape_of
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.manipulator.distribution import Distribution

_HUGE = 1e75
"""Inputs or outputs beyond this count as not finite: their squares might overflow."""

_TINY = 1e-300
"""Tolerance of the discriminant of reach: a pose at the edge, where it is 0, is in reach."""

REDUCIBLE = (
    *("inverse_dynamics", "drive_forces", "feed_forward", "joint_feed_forward"),
    *("pd_gravity", "feed_forward_pd", "computed_torque"),
)
"""Functions whose forces may be computed from base parameters."""

LOADED = (
    *("inverse_dynamics", "forward_dynamics"),
    *("drive_forces", "feed_forward", "joint_feed_forward", "drive_accelerations"),
)
"""Functions that may take a load, a wrench on the platform, as one more input."""

_FORCES = ("inverse_dynamics", "drive_forces", "feed_forward")
"""Functions whose results, forces at the joints, do not depend on the axes of vectors."""

SELECTED = ("base_regressor", "adaptive", "adaptive_drives")
"""Functions that take a choice of base parameters, but not their values."""

_SHARED = ("geometry", "stored", "gains", "parameters", "base_parameters", "drives", "actuators")
"""Inputs of which one value serves a whole batch."""

BY_CASES = ("constraint", "passive_friction")
"""Functions whose equations are others where numbers, such as couples along an axis, are zero: they
have no general program."""

_OF_ONE_MACHINE = (*BY_CASES, "clearances", "least_clearances", "reactions", "beams", "room")
"""Functions whose equations depend on a machine's stored numbers, such as which limits are beyond
half a turn: a general program has those of one machine."""

ALIKE: ContextVar[Manipulator | Literal[True] | None] = ContextVar("alike", default=None)
"""The machine whose general programs are used for others of its topology, within
`sharing_programs`; True: each machine's topology has its own."""

Columns = tuple[tuple[int, ...], ...]
"""For each column of a base regressor, the inertial parameters whose columns it adds up."""


def program(
    robot: RobotLike,
    what: str,
    columns: Columns | None = None,
    *,
    wrench: bool = False,
    guarded: bool = False,
    plain: bool = False,
    named: bool = False,
) -> Program:
    """Return the program of the function `what` of a machine, its geometry folded in.

    Inertial parameters are inputs. With `columns` the dynamics are those of base parameters, which
    are then the input; with `wrench` a wrench on the platform is a further input; with `guarded` a
    last output, `status`, is 1 where the result is valid and 0 where the pose is out of reach or
    singular, or a number is not finite; with `plain` the equations are not optimised; with `named`
    vectors are along the base axes, as the names in exported code say.

    Raises
    ------
    ModelError
        If there is no function of that name, or an option is out of place.
    """
    if what not in TABLE or what in INTERNAL:
        raise ModelError(f"what: {what!r} cannot be compiled; choose from {', '.join(FUNCTIONS)}")
    if what in SELECTED and columns is None:
        raise ModelError(f'base: missing; "{what}" needs base=base_parameters(robot)')
    if what not in (*REDUCIBLE, *SELECTED) and columns is not None:
        useful = ", ".join((*REDUCIBLE, *SELECTED))
        raise ModelError(f"base: {what!r} has no use for it; it goes with {useful}")
    if what not in LOADED and wrench:
        raise ModelError(f"wrench: {what!r} has no use for it; it goes with {', '.join(LOADED)}")
    return _cached_program(
        geometry_only(robot), _Form(what, wrench, guarded, plain, named), columns
    )


def numeric_program(
    robot: RobotLike,
    what: str,
    columns: Columns | None = None,
    *,
    wrench: bool = False,
    guarded: bool = False,
    plain: bool = False,
) -> Program:
    """Return the program that evaluates `what`: with geometry as an input in `sharing_programs`."""
    like = ALIKE.get()
    specialised_names = _OF_ONE_MACHINE if like is True else BY_CASES
    if like is None or columns is not None or what in specialised_names:
        plain = plain or like is not None
        return program(robot, what, columns, wrench=wrench, guarded=guarded, plain=plain)
    return _general(layout_of(robot), _Form(what, wrench, guarded, plain=True))


@contextmanager
def sharing_programs(robot: RobotLike | None = None) -> Iterator[None]:
    """In this context, evaluate many machines of a topology by shared programs.

    Within it the public functions evaluate programs whose geometry is an input, so that nothing is
    built for a machine that differs from `robot` only in its numbers nor, without a `robot`, for a
    machine whose topology has been used before, even in another process. Results are the same up to
    rounding.

    Examples
    --------
    >>> import pteron
    >>> from pteron.kernels import sharing_programs
    >>> from pteron.manipulator import with_dimensions
    >>> with sharing_programs("delta"):
    ...     for crank in (0.3, 0.4):
    ...         robot = with_dimensions("delta", crank=crank)
    ...         print(pteron.inverse_kinematics(robot, [0.0, 0.0, -0.9]).round(3))
    [0.183 0.183 0.183]
    [0.006 0.006 0.006]
    """
    token = ALIKE.set(True if robot is None else geometry_only(robot))
    try:
        yield
    finally:
        ALIKE.reset(token)


def layout_of(robot: RobotLike) -> Manipulator:
    """Return the machine whose geometry programs contain: robot's, or `sharing_programs`'."""
    like = ALIKE.get()
    return like if isinstance(like, Manipulator) else geometry_only(robot)


def specialise_program(given: Program, values: dict[str, NDArray[np.float64]]) -> Program:
    """Return a program with some inputs replaced by numbers, optimised."""
    symbols = given.function.sx_in()
    folded = [
        ca.SX(ca.DM(values[port.name])) if port.name in values else symbol
        for port, symbol in zip(given.inputs, symbols, strict=True)
    ]
    pairs = zip(symbols, given.inputs, strict=True)
    remaining = [(symbol, port) for symbol, port in pairs if port.name not in values]
    results = ca.cse([ca.densify(element) for element in given.function.call(folded)])
    symbols, inputs = [symbol for symbol, _ in remaining], [port for _, port in remaining]
    return Program.from_expressions(given.name, symbols, inputs, results, given.outputs).optimise()


def geometry_only(robot: RobotLike) -> Manipulator:
    """Return the machine with unit inertia and no drives: equal for machines of one geometry."""
    return _cached_geometry_only(as_manipulator(robot))


@lru_cache(maxsize=256)
def _cached_geometry_only(robot: Manipulator) -> Manipulator:
    """Return the machine with unit inertia and no drives, readings, tools or name."""
    ones = ("m", "I", "Ixx", "Iyy", "Izz")

    def plain(body: Any) -> Any:
        """Return a body with unit mass and moments of inertia, other values zero."""
        return body.of_values([float(kind in ones) for kind in body.kinds])

    legs = tuple(
        replace(
            leg.with_bodies({letter: plain(body) for letter, body in leg.bodies.items()}),
            drive=None,
            reading=None,
        )
        for leg in robot.legs
    )
    platform = robot.platform.with_total_inertia(plain(robot.platform.total_inertia))
    shares = robot.distribution
    if robot.redundancy:
        reference, limits = None if shares is None else shares.reference, robot.greatest_forces
        shares = Distribution(limits is not None, reference, robot.drive_strengths, limits)
    named = replace(robot, name="any", legs=legs, platform=platform, distribution=shares)
    return replace(named, radii=None, tools=(), home=None)


class _Form(NamedTuple):
    """A function of the table, and the options of `program` with which it is built."""

    what: str
    wrench: bool = False
    guarded: bool = False
    plain: bool = False
    named: bool = False


@lru_cache(maxsize=512)
def _cached_program(robot: Manipulator, form: _Form, columns: Columns | None) -> Program:
    """Return the program of a function of a machine, cached in memory and on disk."""
    return cached_program((robot, form, columns), partial(_build_program, robot, form, columns))


def _build_program(robot: Manipulator, form: _Form, columns: Columns | None) -> Program:
    """Build the program of a function of a machine, in the form with fewest operations."""
    machine = Machine.numeric(robot)
    if columns is None:
        return _program(machine, form=form)
    selection = ca.SX(len(machine.parameters), len(columns))
    for k, members in enumerate(columns):
        for j in members:
            selection[j, k] = 1
    if form.what in SELECTED:
        return _program(machine, form=form, constants={"selection": selection})
    base = ca.SX.sym("base_parameters", len(columns))
    # A mass on a platform point may be the leg's or the platform's, whichever costs less.
    inertial, extra = ca.mtimes(selection, base), {"base_parameters": base}
    forms = [
        _program(
            machine, form=form, constants={"parameters": inertial, "carried": carried}, extra=extra
        )
        for carried in (True, False)
    ]
    return min(forms, key=lambda candidate: count_operations(candidate.function))


def motion_program(robot: Manipulator, kind: DriveKind, general: bool = False) -> Program:
    """Return the program of stick-slip accelerations and rates, for this kind of drives.

    `kind` has the features of the drives. If `general`, geometry and gravity are an input too.
    """
    layout = geometry_only(robot)
    key = ("motion", layout, kind, *(["general"] if general else []))
    return cached_program(key, partial(_motion, layout, kind, general))


def _motion(robot: Manipulator, kind: DriveKind, general: bool) -> Program:
    """Build the program of stick-slip accelerations and rates."""
    n = robot.joint_count
    names = [*(("side", "hold") if kind.dry else ()), *(name for name, _ in kind.extra_states)]
    extra = {name: ca.SX.sym(name, n) for name in names}
    extra |= {"brake": ca.SX.sym("brake")} if kind.dry else {}
    extra |= {"pace": ca.SX.sym("pace")} if any(kind.lugre) else {}
    extra["actuators"] = ca.SX.sym("actuators", actuator_count(kind))
    form = _Form("driven_motion", wrench=True, guarded=True)
    machine, vectors = Machine.numeric(robot), {}
    if general:
        machine, geometry = Machine.symbolic(robot)
        vectors = {"geometry": geometry}
    return _program(machine, vectors, form=form, constants={"kind": kind}, extra=extra)


def general_program(robot: RobotLike, what: str) -> Program:
    """Return the program of the function `what` of a topology, with `geometry` its first input.

    The vector's order is that of `equations.machine.numbers`.
    """
    return _general(layout_of(robot), _Form(what, plain=True))


def _general(robot: Manipulator, form: _Form) -> Program:
    """Return the program of a topology's function, or the machine's own for some functions."""
    layout = robot if form.what in _OF_ONE_MACHINE else topology_of(robot)
    return _cached_general(layout, form)


@lru_cache(maxsize=256)
def _cached_general(layout: Manipulator, form: _Form) -> Program:
    """Return the program of a topology's function, cached in memory and on disk."""
    return cached_program(("general", layout, form), partial(_build_general, layout, form))


def _build_general(layout: Manipulator, form: _Form) -> Program:
    """Build the program of a topology's function.

    The form is plain: exact arithmetic evaluates the equations as they are written.
    """
    machine, geometry = Machine.symbolic(layout)
    vectors = {"geometry": geometry}
    if form.what not in _OF_ONE_MACHINE:
        vectors["stored"] = ca.SX.sym("stored", len(stored_numbers(layout)))
        symbols = iter(ca.vertsplit(vectors["stored"]))
        machine = replace(machine, robot=with_stored_numbers(layout, symbols))
    return _program(machine, vectors, form=form)


def _program(
    machine: Machine,
    vectors: Mapping[str, Expression] = MappingProxyType({}),
    constants: dict[str, Any] | None = None,
    extra: dict[str, Expression] | None = None,
    *,
    form: _Form,
) -> Program:
    """Build the program of a function of the table, from a machine's equations.

    `vectors` are the machine's numbers as symbols: those that the results depend on, and the
    geometry, become inputs. `constants` replace inputs of the table, and `extra` are further
    inputs.
    """
    what, definition = form.what, TABLE[form.what]
    symbols = _input_symbols(machine, form, constants or {}, extra or {})
    known = symbols | (constants or {})
    if what in _FORCES and not form.named and not vectors:
        seen = machine.move_to_platform_frame(symbols["pose"])
        if seen is not None:
            machine, axes = seen
            if form.wrench:
                parts = ca.vertsplit(symbols["wrench"], 3)
                known["wrench"] = ca.vertcat(*(ca.mtimes(axes.T, part) for part in parts))
    built = definition.build(machine, Inputs(**known))
    forms = [{name: _with_shape(unshaped) for name, unshaped in built.items()}]
    if form.guarded:
        results = [expression for expression, _ in forms[0].values()]
        statuses = _statuses(machine, definition, symbols, results)
        forms = [{**forms[0], "status": (status, ())} for status in statuses]
    everything = ca.veccat(*(expression for expression, _ in forms[0].values()))
    used = [n for n, v in vectors.items() if n == "geometry" or ca.depends_on(everything, v)]
    symbols = {name: vectors[name] for name in used} | symbols
    # A matrix goes out transposed: CasADi stores columns, NumPy rows.
    dense = (
        [ca.densify(expression).T for expression, _ in candidate.values()] for candidate in forms
    )
    names = list(symbols), list(forms[0])
    functions = (
        ca.Function(what, list(symbols.values()), ca.cse(candidate), *names) for candidate in dense
    )
    function = min(functions, key=count_operations)
    if not form.plain:
        function = optimise_function(function)
    columns = machine.robot.column_names
    inputs = tuple(
        Port(name, symbol.shape[:1], name in _SHARED, columns.get(name, ()))
        for name, symbol in symbols.items()
    )
    ports = tuple(Port(name, tuple(shape)) for name, (_, shape) in forms[0].items())
    return Program(what, function, inputs, ports)


def _input_symbols(
    machine: Machine, form: _Form, constants: dict[str, Any], extra: dict[str, Expression]
) -> dict[str, Expression]:
    """Return the inputs of a function as symbols by name, shared inputs last."""
    names = [name for name in TABLE[form.what].inputs if name not in constants]
    names += ["wrench"] if form.wrench else []
    n, selected = len(machine.legs), constants.get("selection", ca.SX.eye(0)).shape[1]
    sizes = {
        "parameters": len(machine.parameters),
        "wrench": machine.wrench_size,
        "twist": 6,
        "mass": 1,
        "center": 3,
        "pivot": 3,
        "inertia": inertia_count(machine.robot.platform.inertia.kinds),
        **dict.fromkeys(("joints", "joint_rates", "joint_accelerations", "forces"), n),
        "drives": len(Drives._fields) * n,
        **control.input_sizes(form.what, machine.freedom, n, selected),
    }
    symbols = {name: ca.SX.sym(name, sizes.get(name, machine.freedom)) for name in names}
    symbols |= extra
    return {name: symbols[name] for name in sorted(symbols, key=_shared_last)}


def _shared_last(name: str) -> int:
    """Return a sort key of an input name: -1 if it varies by state, else its shared position."""
    return _SHARED.index(name) if name in _SHARED else -1


def _with_shape(unshaped: Output) -> tuple[Expression, tuple[int, ...]]:
    """Return an output as one expression, parts stacked, and its array shape."""
    if isinstance(unshaped, tuple):
        return unshaped
    if isinstance(unshaped, list):
        return ca.vertcat(*unshaped), (len(unshaped), *unshaped[0].shape)
    return unshaped, shape_of(unshaped)


def _statuses(
    machine: Machine, definition: Entry, symbols: dict[str, Expression], results: list[Expression]
) -> list[Expression]:
    """Return candidate expressions of the validity flag (1 valid, 0 invalid or NaN).

    The candidate that shares most subexpressions with the results is the cheapest.
    """
    states = [symbol for name, symbol in symbols.items() if name not in _SHARED]
    sums = [
        sum(
            ca.fabs(v)
            for group in groups
            for v in ca.vertsplit(ca.vec(ca.densify(group)))
            if not _is_nan(v)
        )
        for groups in (states, results)
    ]
    status = ca.SX(1)
    for total in sums if definition.needs == ("reach",) else sums[:1]:
        status = ca.if_else(total < _HUGE, status, 0)
    if {"reach", "rows"} & set(definition.needs):
        reaches = kinematics.reach(machine, symbols["pose"])
        for leg, at in zip(machine.legs, reaches, strict=True):
            if "reach" in definition.needs or not leg.row_is_constant:
                least = -_TINY if definition.needs == ("reach",) else TYPE_I**2 * at.scale
                status = ca.if_else(least < at.discriminant, status, 0)  # Remark 2
    if "angles" in definition.needs:
        zero_rates = ca.SX.zeros(machine.freedom)
        measure = machine.platform.motion(symbols["pose"], zero_rates, zero_rates).angle_measure
        if not measure.is_constant():
            status = ca.if_else(measure * measure > ANGLES**2, status, 0)
    if "type II" not in definition.needs:
        return [status]
    state = machine.state(symbols["pose"])
    return [
        ca.if_else(square < _HUGE, ca.if_else(square > TYPE_II**2, status, 0), 0)
        for square in machine.closure.measure_squares(state.platform, state.legs)
    ]


def _is_nan(expression: Expression) -> bool:
    """Return whether an expression is the constant NaN."""
    return bool(expression.is_constant()) and bool(np.isnan(float(expression)))
