"""`pteron identify`: from recorded motions to parameters, a model of real bodies, and a verdict."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Argument, Option

from pteron.cli.arguments import Elbows, Json
from pteron.cli.progress import spinner
from pteron.cli.robots import load_robot
from pteron.cli.screen import show_json
from pteron.cli.stages import stages
from pteron.errors import DataError

if TYPE_CHECKING:
    from pteron.identification import Bounds, Terms
    from pteron.identification.consistency.bounds import Box
    from pteron.manipulator import Manipulator

__all__ = ["identify"]

_TERMS = ("coulomb", "viscous", "offset")


class _Estimator(StrEnum):
    WEIGHTED = "weighted"
    ORDINARY = "ordinary"
    HUBER = "huber"
    TOTAL = "total"
    LIKELIHOOD = "likelihood"


class _Joints(StrEnum):
    NONE = "none"
    SHARED = "shared"
    EACH = "each"


class _Derivatives(StrEnum):
    PERIODIC = "periodic"
    CENTRAL = "central"
    SPLINE = "spline"


def identify(
    logs: Annotated[
        list[str],
        Argument(metavar="LOG...", help="Recorded motions, .csv or .parquet: t rho1.. force1.."),
    ],
    robot: Annotated[str, Option("--robot", metavar="ROBOT", help="The machine as it is drawn.")],
    out: Annotated[str, Option("--out", metavar="DIR", help="The folder to write it to.")],
    held_out: Annotated[
        list[str] | None,
        Option(
            "--held-out",
            metavar="LOG",
            help="What to judge by; once for each. By default the last 30 % of every log.",
        ),
    ] = None,
    description: Annotated[
        str | None,
        Option("--description", metavar="TOML", help="Of all logs; by default beside each."),
    ] = None,
    estimator: Annotated[
        _Estimator, Option("--estimator", help="How the equations are solved.")
    ] = _Estimator.WEIGHTED,
    without: Annotated[
        str | None,
        Option("--without", metavar="TERMS", help="Leave out: coulomb,viscous,offset."),
    ] = None,
    joints: Annotated[
        _Joints, Option("--joints", help="Viscous friction in the passive joints.")
    ] = _Joints.NONE,
    rotors: Annotated[bool, Option("--rotors", help="With the inertia of the motors.")] = False,
    payload: Annotated[bool, Option("--payload", help="With the payload carried.")] = False,
    shared: Annotated[
        bool, Option("--shared", help="All legs share one set of inertial parameters.")
    ] = False,
    derivatives: Annotated[
        _Derivatives | None,
        Option("--derivatives", help="How positions are differentiated; the data decide."),
    ] = None,
    cutoff: Annotated[
        float | None, Option("--cutoff", metavar="HZ", help="Of the positions' filter.")
    ] = None,
    band: Annotated[
        float | None, Option("--band", metavar="HZ", help="Of the filter on both sides.")
    ] = None,
    period: Annotated[
        float | None, Option("--period", metavar="S", help="After which the motion repeats.")
    ] = None,
    cad: Annotated[
        str,
        Option("--cad", metavar="WHICH", help="Bodies are near: robot, none, or a machine's file."),
    ] = "robot",
    boxes: Annotated[
        list[str] | None,
        Option("--box", metavar="BODY=X0,X1,Y0,Y1", help="Holds all mass of u1, l3, e, u, ...; m."),
    ] = None,
    elbows: Elbows = None,
    as_json: Json = False,
) -> None:
    """Identify a machine from recorded motions, and say whether the result can be trusted.

    The folder gets identification.html to read, identification.json with all numbers, and the
    machine with real bodies as NAME.toml. The exit code is 0 whatever the verdict.
    """
    machine = load_robot(robot, elbows)
    drawn = _cad(cad)
    with spinner("Opening the logs"):
        from pteron.identification import Processing, open_log
        from pteron.identification import identify as identified
        from pteron.report.identification import (
            model_path,
            numbers,
            prepared_folder,
            write_identification,
        )

        terms = _terms(without, joints, rotors=rotors, payload=payload)
        bounds = _bounds(boxes or (), machine)
        processing = Processing(
            None if derivatives is None else derivatives.value, cutoff, band, period
        )
        fit, check = (
            [open_log(path, machine, description=description) for path in paths]
            for paths in (logs, held_out or [])
        )
    read = [*logs, *(held_out or ()), *(path for path in (robot, description) if path)]
    sources = [path for path in read if Path(path).is_file()]
    model_path(out, machine.name, sources)
    rows = sum(log.rows_estimate or 0 for log in (*fit, *check))
    with prepared_folder(out) as folder:
        with stages(f"Identifying {machine.name}", rows) as tell:
            result = identified(
                machine,
                fit,
                held_out=check,
                terms=terms,
                shared=shared,
                estimator=estimator.value,
                processing=processing,
                cad=drawn,
                bounds=bounds,
                progress=tell,
            )
        with spinner("Drawing the report"):
            files = write_identification(result, folder, sources=sources)
    if as_json:
        show_json({"files": [str(path) for path in files.paths], **numbers(result)})
        return
    from pteron.cli.identified import show_identification

    show_identification(result, files)


def _terms(without: str | None, joints: _Joints, *, rotors: bool, payload: bool) -> Terms:
    from pteron.identification import Terms

    left_out = [] if without is None else [name.strip() for name in without.split(",")]
    for name in left_out:
        if name not in _TERMS:
            raise DataError(f"--without: {name!r} is not one of {', '.join(_TERMS)}")
    return Terms(
        coulomb="coulomb" not in left_out,
        viscous="viscous" not in left_out,
        offset="offset" not in left_out,
        joints=joints.value,
        payload=payload,
        rotors=rotors,
    )


def _cad(which: str) -> Manipulator | Literal["robot"] | None:
    if which == "robot":
        return "robot"
    return None if which == "none" else load_robot(which)


def _bounds(boxes: list[str] | tuple[()], machine: Manipulator) -> Bounds | None:
    """Return the boxes as bounds, refused before the work if they do not fit the machine."""
    if not boxes:
        return None
    from pteron.identification import Bounds

    bounds = Bounds(boxes=dict(_box(text) for text in boxes))
    bounds.limits(machine)
    return bounds


def _box(text: str) -> tuple[str, Box]:
    body, _, numbers = text.partition("=")
    try:
        x0, x1, y0, y1 = (float(number) for number in numbers.split(","))
    except ValueError:
        raise DataError(
            f"--box: {text!r} given, a body and four numbers in m expected, such as "
            "u1=-0.02,0.17,-0.03,0.03"
        ) from None
    return body.strip(), ((x0, x1), (y0, y1))
