"""Base parameters for exported code: a machine's own, or those that `pteron identify` found.

They are the set that `pteron identify` prints, in its order and units. The code may compute with
another set that costs fewer operations; a constant matrix leads from the one to the other.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from pteron.errors import DataError, ModelError
from pteron.kernels import (
    Array,
    Port,
    Program,
    columns_of,
    count_operations,
    program,
    specialise_program as with_values,
)
from pteron.legs import Drive, LegKind, Stribeck
from pteron.manipulator import Manipulator
from pteron.manipulator.machine_record import expect_machine
from pteron.reduction import BaseParameters, base_parameters, cheapest_parameters
from pteron.toml import expect_regular

_NAME = "base_parameters"
"""Name of the base parameters as an input of the code, and as a key of the identified file."""


@dataclass(frozen=True)
class Identified:
    """Base parameters with values, and the machine with the drives that go with them."""

    robot: Manipulator
    base: BaseParameters
    values: Array
    comments: tuple[str, ...]
    """The expression of each value, and its unit."""
    grade: str = ""
    """The verdict of the identification."""

    @classmethod
    def from_robot(cls, robot: Manipulator) -> Identified:
        """Return a machine's base parameters, with the values of its file."""
        base = base_parameters(robot)
        return cls(robot, base, base.values(), _comments(base, base.expressions()))


def read_identified(robot: Manipulator, path: str | Path) -> Identified:
    """Return base parameters, friction and offsets that `pteron identify` wrote for a machine.

    What a drive's file says of the motor and its limits stays; a rotor's inertia is in the base
    parameters that it joins, or among the values.

    Raises
    ------
    DataError
        If the file cannot be read, is none of `pteron identify`, belongs to another machine, or has
        values that exported code has no place for.
    """
    document = _object(path)
    try:
        known, drives, kinds = document[_NAME], document["drives"], document["kinds"]
        names, expressions = known["names"], known["expressions"]
        base_values = np.array(known["values"], dtype=float)
        legs = [_with_friction(leg, drive) for leg, drive in zip(robot.legs, drives, strict=False)]
        all_names, texts = document["estimate"]["names"], [*map(str, document["expressions"])]
        if not (np.isfinite(base_values).all() and len(texts) >= len(base_values)):
            raise ValueError("values are missing")
        groups = [tuple(group) for group in known["shared"]]
        grade = re.sub(r"[^a-z ]", "?", str(document["verdict"]["grade"])[:40])
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise DataError(
            f"{path}: not an identification.json of this version of pteron identify "
            f"({type(error).__name__}: {error}); run it again"
        ) from None
    expect_machine(document.get("machine"), robot, path)
    if passive := [n for n, kind in zip(all_names, kinds, strict=False) if kind == "passive"]:
        raise DataError(
            f"{path}: {', '.join(passive)}: friction of passive joints, which exported code has no "
            "place for; identify again without --joints"
        )
    try:
        base = base_parameters(robot, shared=groups or False)
        # A record has been compared: dimensions may differ a little, as a calibrated machine's do.
        alike = "machine" in document or list(base.expressions(digits=12)) == expressions
        same = list(base.names) == names and alike
    except ModelError:
        same = False
    if not same or len(drives) != robot.joint_count or base_values.shape != (base.rank,):
        raise DataError(
            f"{path}: base parameters of another machine ({str(document.get('robot'))[:60]!r}), "
            f"not of {robot.name!r}: names or groupings differ; give the robot that was identified"
        )
    driven = replace(robot, legs=tuple(legs))
    return Identified(driven, base, base_values, _comments(base, texts), grade)


def _object(path: str | Path) -> dict[str, Any]:
    """Return the object in a JSON file; empty if the file holds another kind of value."""
    try:
        expect_regular(Path(path))
        document = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise DataError(f"{path}: {error.strerror or error}") from None
    except (ValueError, RecursionError):
        raise DataError(
            f"{path}: no JSON; give the identification.json that pteron identify writes"
        ) from None
    return document if isinstance(document, dict) else {}


def _with_friction(leg: LegKind, friction: dict[str, Any]) -> LegKind:
    """Return a leg with its joint's identified friction and rotor inertia."""
    drive, law = leg.drive or Drive(), friction["stribeck"]
    return replace(
        leg,
        drive=replace(
            drive,
            **{name: friction[name] for name in ("coulomb", "viscous", "offset")},
            stribeck=law and Stribeck(law["force"], law["speed"]),
            rotor_inertia=(friction["inertia"] - drive.screw_inertia) / drive.gear**2,
        ),
    )


def _comments(base: BaseParameters, expressions: Sequence[str]) -> tuple[str, ...]:
    """Return the comments beside the values; a file's text must not end the comment around it."""
    units = (base.parameters[k].unit for k in base.kept)
    safe = (
        "".join(c if c.isascii() and c.isprintable() and c != "*" else "?" for c in text)
        for text in expressions
    )
    return tuple(f"{text}, {unit}" for text, unit in zip(safe, units, strict=False))


def base_program(what: str, identified: Identified, *, wrench: bool, folded: bool) -> Program:
    """Return a function of base parameters; with `folded`, of their values.

    Of the machine's base set and of the one that costs least, it computes with the one that needs
    fewer operations in all.
    """
    robot, base = identified.robot, identified.base
    if what == "set_payload":
        return _payload_program(robot, base)
    cheapest = cheapest_parameters(robot)
    direct, other = (
        program(robot, what, columns_of(parameters), wrench=wrench)
        for parameters in (base, cheapest)
    )
    # Forces of base parameters b are those of the inertial parameters selection b.
    matrix = cheapest.grouping @ base.selection
    forms = [direct, _substitute_parameters(other, matrix)]
    if folded:
        forms = [
            with_values(direct, {_NAME: identified.values}),
            with_values(other, {_NAME: matrix @ identified.values}),
        ]
    return min(forms, key=lambda form: count_operations(form.function))


def _payload_program(robot: Manipulator, base: BaseParameters) -> Program:
    """Return `set_payload` for base parameters, to which it adds those of a payload."""
    load = program(robot, "set_payload")
    mass, center, inertia, parameters = load.function.sx_in()
    load_parameters = load.function(mass, center, inertia, ca.SX.zeros(parameters.shape))
    base_symbols = ca.SX.sym(_NAME, base.rank)
    grouping = ca.sparsify(ca.SX(ca.DM(base.grouping)))
    ports = (*load.inputs[:3], Port(_NAME, (base.rank,), shared=True))
    loaded = Port(f"loaded_{_NAME}", (base.rank,))
    loaded_values = base_symbols + ca.mtimes(grouping, load_parameters.T)
    return Program.from_expressions(
        load.name, [mass, center, inertia, base_symbols], ports, [loaded_values], [loaded]
    ).optimise()


def _substitute_parameters(function: Program, matrix: Array) -> Program:
    """Return a program with input b from a program with input matrix @ b."""
    place = next(k for k, port in enumerate(function.inputs) if port.name == _NAME)
    symbols, ports = function.function.sx_in(), list(function.inputs)
    symbols[place] = ca.SX.sym(_NAME, matrix.shape[1])
    ports[place] = Port(_NAME, matrix.shape[1:], shared=True)
    taken = list(symbols)
    taken[place] = ca.mtimes(ca.sparsify(ca.SX(ca.DM(matrix))), symbols[place])
    results = function.function.call(taken)
    return Program.from_expressions(
        function.name, symbols, ports, results, function.outputs
    ).optimise()
