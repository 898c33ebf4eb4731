"""Manipulators in TOML files: `load` reads one, by catalog name or path, and `save` writes one."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from difflib import get_close_matches
from errno import ENOENT
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pteron.atomic import write_text
from pteron.errors import ModelError
from pteron.manipulator.inertia import PlanarInertia
from pteron.manipulator.leg import Leg
from pteron.manipulator.manipulator import Manipulator
from pteron.manipulator.platform import Platform

if TYPE_CHECKING:
    from pydantic import ValidationError

    from pteron.manipulator.schema import BodyTable, LegTable, ManipulatorTable

__all__ = ["catalog", "load", "save"]

_Built = TypeVar("_Built")


def catalog() -> tuple[str, ...]:
    """Return the names of the machines that come with Pteron."""
    folder = files("pteron.manipulator") / "catalog"
    return tuple(sorted(f.name[:-5] for f in folder.iterdir() if f.name.endswith(".toml")))


def load(name_or_path: str | Path) -> Manipulator:
    """Read a manipulator from the catalog or from a TOML file.

    Parameters
    ----------
    name_or_path : str or path
        A catalog name (``"quadrupteron"``, ``"tripteron"``, ...) or the path of a file.

    Returns
    -------
    Manipulator
        The machine, checked.

    Raises
    ------
    ModelError
        If there is no such name or file, or if the file is not TOML, lacks a key, has an unknown
        one, or describes a machine that cannot be; the message names the key.

    Examples
    --------
    >>> import pteron
    >>> pteron.load("tripteron").coordinates
    ('x', 'y', 'z')
    """
    if str(name_or_path) in catalog():
        resource = files("pteron.manipulator") / "catalog" / f"{name_or_path}.toml"
        return _parse(resource.read_text(encoding="utf-8"), str(name_or_path))
    path = Path(name_or_path)
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise ModelError(f"{path}: not a TOML file (it is not UTF-8 text)") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise ModelError(_not_found(path, error)) from None
    return _parse(text, str(path))


def _not_found(path: Path, error: OSError | ValueError) -> str:
    if isinstance(error, OSError) and error.errno != ENOENT:
        return f"{path}: cannot be read ({error.strerror})"
    close = get_close_matches(str(path), catalog(), n=1)
    guess = f'; did you mean "{close[0]}"?' if close else ""
    return f"{path}: neither a file nor a machine of the catalog ({', '.join(catalog())}){guess}"


def _parse(text: str, source: str) -> Manipulator:
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ModelError(f"{source}: not a TOML file ({error})") from None
    from pydantic import ValidationError

    from pteron.manipulator.schema import ManipulatorTable

    try:
        table = ManipulatorTable.model_validate(document)
    except ValidationError as error:
        raise _faulty(source, _faults(error)) from None
    faults: list[str] = []
    robot = _manipulator(table, faults)
    if robot is None:
        raise _faulty(source, faults)
    return robot


def _faulty(source: str, faults: list[str]) -> ModelError:
    """Return the error of a file: its message has the first fault, its attribute all of them."""
    more = len(faults) - 1
    others = f" (and {more} more {'fault' if more == 1 else 'faults'})" if more else ""
    return ModelError(
        f"{source}: {faults[0]}{others}", faults=tuple(f"{source}: {fault}" for fault in faults)
    )


def _faults(error: ValidationError) -> list[str]:
    """Return each fault on one line: the key, what was given and what was expected."""
    lines = []
    for fault in error.errors(include_url=False):
        key = "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in fault["loc"]).lstrip(".")
        kind, given = fault["type"], fault["input"]
        if kind == "missing":
            lines.append(f"{key}: missing; the file must give it")
        elif kind == "extra_forbidden":
            lines.append(f"{key}: unknown key (value {given!r}); check its spelling or remove it")
        else:
            lines.append(f"{key}: {given!r} given; {fault['msg'][0].lower()}{fault['msg'][1:]}")
    return lines


def _manipulator(table: ManipulatorTable, faults: list[str]) -> Manipulator | None:
    """Return the machine; None where its parts have faults, which are added to the list."""
    p = table.platform
    parts: list[Any] = []
    builders: list[tuple[str, Callable[[], Any]]] = [
        ("platform", lambda: Platform(p.motion, _body(p), axis=p.axis, x_axis=p.x_axis)),
        *((f"legs[{i}]", partial(_leg, leg)) for i, leg in enumerate(table.legs)),
    ]
    for key, build in builders:
        try:
            parts.append(_under(key, build))
        except ModelError as error:
            faults.append(str(error))
    if not faults:
        try:
            return Manipulator(table.name, parts[0], tuple(parts[1:]), table.gravity)
        except ModelError as error:
            faults.append(str(error))
    return None


def _leg(table: LegTable) -> Leg:
    return Leg(
        guide_point=table.guide_point,
        direction=table.direction,
        platform_point=table.platform_point,
        upper_length=table.upper_length,
        lower_length=table.lower_length,
        slider_mass=table.slider.mass,
        upper=_under("upper", partial(_body, table.upper)),
        lower=_under("lower", partial(_body, table.lower)),
        slider_direction=table.slider_direction,
        elbow=table.elbow,
        slider_limits=table.slider_limits,
    )


def _body(table: BodyTable) -> PlanarInertia:
    if (table.center_of_mass is None) == (table.first_moment is None):
        given = "neither" if table.first_moment is None else "both"
        raise ModelError(f"center_of_mass: {given} it and first_moment given; give one of the two")
    if table.first_moment is not None:
        return PlanarInertia(table.mass, table.first_moment, table.inertia)
    assert table.center_of_mass is not None
    return PlanarInertia.of_body(table.mass, table.center_of_mass, table.inertia)


def _under(key: str, build: Callable[[], _Built]) -> _Built:
    """Return what `build` makes, with `key` put before the key that its error names."""
    try:
        return build()
    except ModelError as error:
        raise ModelError(f"{key}.{error}") from None


def save(robot: Manipulator, path: str | Path) -> Path:
    """Write a manipulator to a TOML file that `load` reads back without loss.

    Parameters
    ----------
    robot : Manipulator
        The machine.
    path : str or path
        The file; it is replaced whole, or not at all.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    import tomlkit

    document = tomlkit.document()
    document.add(
        tomlkit.comment("A parallel manipulator for Pteron. SI units: m, kg, kg m, kg m^2, m/s^2.")
    )
    document.add("name", tomlkit.item(robot.name))
    document.add("gravity", tomlkit.item(list(robot.gravity)))
    platform = tomlkit.table()
    for key, value in _platform_items(robot.platform):
        platform.add(key, value)
    document.add("platform", platform)
    legs = tomlkit.aot()
    for leg in robot.legs:
        table = tomlkit.table()
        for key, value in _leg_items(leg):
            table.add(key, _inline(value) if isinstance(value, dict) else value)
        legs.append(table)
    document.add("legs", legs)
    return write_text(path, tomlkit.dumps(document))


def _inline(items: dict[str, Any]) -> Any:
    import tomlkit

    table = tomlkit.inline_table()
    table.update(items)
    return table


def _platform_items(platform: Platform) -> list[tuple[str, Any]]:
    x, _, axis = platform.frame
    return [
        ("motion", platform.motion),
        ("axis", list(axis)),
        ("x_axis", list(x)),
        *_body_items(platform.inertia).items(),
    ]


def _leg_items(leg: Leg) -> list[tuple[str, Any]]:
    items: list[tuple[str, Any]] = [
        ("guide_point", list(leg.guide_point)),
        ("direction", list(leg.direction)),
    ]
    if leg.slider_direction is not None:
        items.append(("slider_direction", list(leg.slider_direction)))
    items += [
        ("platform_point", list(leg.platform_point)),
        ("upper_length", leg.upper_length),
        ("lower_length", leg.lower_length),
        ("elbow", leg.elbow),
    ]
    if leg.slider_limits is not None:
        items.append(("slider_limits", list(leg.slider_limits)))
    return [
        *items,
        ("slider", {"mass": leg.slider_mass}),
        ("upper", _body_items(leg.upper)),
        ("lower", _body_items(leg.lower)),
    ]


def _body_items(body: PlanarInertia) -> dict[str, Any]:
    return {"mass": body.mass, "first_moment": list(body.first_moment), "inertia": body.inertia}
