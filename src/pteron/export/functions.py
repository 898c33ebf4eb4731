"""The choice of functions to export as code."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from pteron.controllers import CONTROLLERS, Controller, Custom
from pteron.equations.machine import closure_of
from pteron.errors import ModelError
from pteron.export.command_units import DRIVEN, Output, factors
from pteron.export.exported_function import (
    BASE,
    PAYLOAD,
    ExportedFunction,
    ExportRequest,
    exported_function,
)
from pteron.export.identified_parameters import Identified, read_identified
from pteron.kernels import FUNCTIONS as COMPILED, REDUCIBLE
from pteron.kernels.functions import TABLE
from pteron.manipulator import Manipulator

FUNCTIONS = (
    "inverse_kinematics",
    "direct_kinematics",
    "jacobian",
    "inverse_dynamics",
    "inverse_dynamics_base",
    "forward_dynamics",
    "regressor",
    "set_payload",
)
"""Functions exported by default, and those of `FEED` for a machine with drives. Where direct
kinematics has no closed form, `direct_step` takes its place."""

FEED = ("feed_forward", "joint_feed_forward")
"""Feed-forward for a controller, from the platform's motion or from the joints'."""

FunctionChoice = str | Controller | Custom | Sequence[str | Controller | Custom]
"""A choice of functions, by name, and of controllers, whose laws they are."""

PLACES = ("pose", "joints", "motors")
"""Inputs that say where the machine is."""


def has_drives(robot: Manipulator) -> bool:
    """Return whether the machine's file has drives of its joints."""
    return any(leg.drive is not None for leg in robot.legs)


def choice_list(functions: FunctionChoice) -> list[str | Controller | Custom]:
    """Return a choice of functions as a list."""
    single = isinstance(functions, str | Controller | Custom)
    return [functions] if single else list(functions)  # type: ignore[arg-type, list-item]


def exported_functions(
    robot: Manipulator,
    functions: FunctionChoice | None,
    *,
    usual: Sequence[str] = FUNCTIONS,
    specialised: bool,
    wrench: bool = False,
    output: Output = "force",
    base: str | Path | None = None,
    tables: bool = True,
) -> tuple[ExportedFunction, ...]:
    """Return the functions to export: by default the `usual` ones.

    `tables` says whether the code can have tables of the machine's own values. Where not, they are
    folded in, all but the inertial parameters that `set_payload` returns.

    Without a closed form for every pose that joints have, there is the step from the last one.

    Raises
    ------
    ModelError
        If a name is unknown, or there is none; if a drive does not say what the output needs.
    DataError
        If the file of identified base parameters is not one of this machine.
    """
    identified = None if base is None else read_identified(robot, base)
    robot = identified.robot if identified else robot
    requested = [] if functions is None else choice_list(functions)
    named = {choice.law_name: choice for choice in requested if not isinstance(choice, str)}
    names = [choice if isinstance(choice, str) else choice.law_name for choice in requested]
    custom = {name for name, choice in named.items() if isinstance(choice, Custom)}
    if functions is None:
        names = _usual_names(robot, usual, identified, specialised)
    names = list(dict.fromkeys(names))
    _expect_exportable(names, custom, specialised)
    factors(robot, output)
    if output != "force" and not {name.removesuffix(BASE) for name in names} & {*DRIVEN, *custom}:
        raise ModelError(
            f'output: "{output}" is what drives are told, but none of {", ".join(DRIVEN)} is '
            "written; name one of them"
        )
    controllers: dict[str, Controller | Custom] = {**CONTROLLERS, **named}

    def request(name: str) -> ExportRequest:
        """Return a function's export request by its name, with tables, controller and folding."""
        what = name if name in custom else name.removesuffix(BASE)
        folded, controller = specialised or (not tables and what == PAYLOAD), controllers.get(what)
        return ExportRequest(robot, name, identified, folded, tables, wrench, output, controller)

    return tuple(exported_function(request(name)) for name in names)


def _usual_names(
    robot: Manipulator, usual: Sequence[str], identified: Identified | None, specialised: bool
) -> list[str]:
    """Return the names of the functions exported by default."""
    closed = closure_of(robot).closed_form
    step = {"direct_kinematics": "direct_step"}
    names = [name if closed else step.get(name, name) for name in usual]
    if identified:  # which leaves the bodies unknown
        inputs: Mapping[str, Sequence[str]] = {n: TABLE[n].inputs for n in names if n in TABLE}
        names = [name for name in names if "parameters" not in inputs.get(name, ())]
        names += [name + BASE for name in (*FEED, PAYLOAD)]
    elif has_drives(robot):
        names += FEED
    if specialised:
        names = [name for name in names if name.removesuffix(BASE) != PAYLOAD]
    return names


def _expect_exportable(names: Sequence[str], custom: set[str], specialised: bool) -> None:
    """Raise ModelError on unknown names, custom names that Pteron uses, or an empty choice."""
    based = {name + BASE for name in (*REDUCIBLE, PAYLOAD)}
    allowed = sorted({*COMPILED, *based} - {"base_regressor"})
    valid = f"choose from {', '.join(allowed)}"
    for name in names:
        if name in custom and name in allowed:
            raise ModelError(
                f"functions: {name!r} is the name of a function of pteron; give the controller's "
                "casadi.Function another one"
            )
        if name not in allowed and name not in custom:
            raise ModelError(f"functions: {name!r} cannot be exported; {valid}")
        if specialised and name.removesuffix(BASE) == PAYLOAD:
            raise ModelError(
                f"functions: {name!r} returns parameters, which `specialised` folds into the code; "
                "leave one of them out"
            )
    if not names:
        raise ModelError(f"functions: none given; {valid}")
