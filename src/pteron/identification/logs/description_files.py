"""The TOML file beside a log: found, read and written."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pteron.atomic import write_text
from pteron.errors import DataError
from pteron.identification.logs.description import Description, KnownPayload

if TYPE_CHECKING:
    from pydantic import ValidationError

    from pteron.identification.logs.schema import DescriptionTable, PayloadTable

__all__ = ["find_description", "read_description", "write_description"]


def find_description(log_path: str | Path) -> Path | None:
    """Return the TOML file beside a log, of the same stem, or None where there is none."""
    path = Path(log_path).with_suffix(".toml")
    return path if path.is_file() else None


def read_description(path: str | Path) -> Description:
    """Read the description of a log from a TOML file, in which every key is optional.

    Parameters
    ----------
    path : str or path
        The file. Its tables: ``[time]`` column, unit; ``[sliders]`` columns, unit; ``[forces]``
        columns, unit, gains, limits; ``[pose]`` columns, length_unit, angle_unit; ``[payload]``
        column, mass, center_of_mass or first_moment, inertia; ``[motion]`` period, assembly_mode;
        ``[drives]`` rotor_inertia, ratio.

    Returns
    -------
    Description

    Raises
    ------
    DataError
        If there is no such file, or if it is not TOML, has an unknown key or a value that cannot
        be; the message names the key, and the valid ones.
    """
    file = Path(path)
    try:
        document = tomllib.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DataError(f"{path}: no such file; it should describe a log") from None
    except UnicodeDecodeError:
        raise DataError(f"{path}: not a TOML file (it is not UTF-8 text)") from None
    except tomllib.TOMLDecodeError as error:
        raise DataError(f"{path}: not a TOML file ({error})") from None
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from None
    from pydantic import ValidationError

    from pteron.identification.logs.schema import DescriptionTable

    try:
        table = DescriptionTable.model_validate(document)
    except ValidationError as error:
        raise DataError(f"{path}: {_first_fault(error)}") from None
    try:
        return _description(table)
    except DataError as error:
        raise DataError(f"{path}: {error}") from None


def write_description(description: Description, path: str | Path) -> Path:
    """Write a description to a TOML file that `read_description` reads back without loss.

    Raises
    ------
    OutputError
        If the file cannot be written; one that was there is left as it was.
    """
    import tomlkit

    document = tomlkit.document()
    document.add(tomlkit.comment("A log for Pteron: its columns, their units, what is known."))
    for name, entries in _tables(description).items():
        given = {key: value for key, value in entries.items() if value is not None}
        if not given:
            continue
        table = tomlkit.table()
        for key, value in given.items():
            table.add(key, _plain(value))
        document.add(name, table)
    return write_text(path, tomlkit.dumps(document))


def _first_fault(error: ValidationError) -> str:
    """Return the first fault on one line: the key, what was given and what was expected."""
    from pteron.identification.logs.schema import keys_at

    fault = error.errors(include_url=False)[0]
    location = fault["loc"]
    if fault["type"] == "extra_forbidden":
        key = ".".join(str(part) for part in location)
        return f"{key}: unknown key; the valid ones there are {', '.join(keys_at(location))}"
    # Behind the key stand the branches that pydantic tried.
    key = ".".join(str(part) for part in location[:2])
    key += "".join(f"[{part}]" for part in location[2:] if isinstance(part, int))
    message = fault["msg"]
    return f"{key}: {fault['input']!r} given; {message[0].lower()}{message[1:]}"


def _description(table: DescriptionTable) -> Description:
    return Description(
        time_column=table.time.column,
        time_unit=table.time.unit,
        slider_columns=table.sliders.columns,
        slider_unit=table.sliders.unit,
        force_columns=table.forces.columns,
        column_force_unit=table.forces.unit,
        gains=table.forces.gains,
        limits=_pairs(table.forces.limits),
        pose_columns=table.pose.columns,
        length_unit=table.pose.length_unit,
        angle_unit=table.pose.angle_unit,
        payload_column=table.payload.column,
        payload=_payload(table.payload),
        period=table.motion.period,
        assembly_mode=table.motion.assembly_mode,
        rotor_inertia=table.drives.rotor_inertia,
        ratio=table.drives.ratio,
    )


def _pairs(limits: tuple[Any, ...] | None) -> tuple[tuple[float, float], ...] | None:
    if limits is None or isinstance(limits[0], tuple):
        return limits
    return ((limits[0], limits[1]),)


def _payload(table: PayloadTable) -> KnownPayload | None:
    center, moment, inertia = table.center_of_mass, table.first_moment, table.inertia
    if table.mass is None:
        if any(value is not None for value in (center, moment, inertia)):
            raise DataError("payload.mass: missing; a known payload needs it")
        return None
    if center is None and moment is None and inertia is None:
        return KnownPayload(table.mass)
    if inertia is None:
        raise DataError("payload.inertia: missing; give it about P, in kg m^2")
    if (center is None) == (moment is None):
        given = "neither" if center is None else "both"
        raise DataError(
            f"payload.center_of_mass: {given} it and first_moment given; give one of the two"
        )
    if center is not None:
        moment = (table.mass * center[0], table.mass * center[1])
    assert moment is not None
    return KnownPayload(table.mass, moment, inertia)


def _tables(given: Description) -> dict[str, dict[str, Any]]:
    known = given.payload
    return {
        "time": {"column": given.time_column, "unit": given.time_unit},
        "sliders": {"columns": given.slider_columns, "unit": given.slider_unit},
        "forces": {
            "columns": given.force_columns,
            "unit": given.column_force_unit,
            "gains": given.gains,
            "limits": given.limits,
        },
        "pose": {
            "columns": given.pose_columns,
            "length_unit": given.length_unit,
            "angle_unit": given.angle_unit,
        },
        "payload": {
            "column": given.payload_column,
            "mass": known and known.mass,
            "first_moment": known and known.first_moment,
            "inertia": known and known.inertia,
        },
        "motion": {"period": given.period, "assembly_mode": given.assembly_mode},
        "drives": {"rotor_inertia": given.rotor_inertia, "ratio": given.ratio},
    }


def _plain(value: Any) -> Any:
    """Return tuples as lists, as TOML knows them."""
    return [_plain(item) for item in value] if isinstance(value, tuple) else value
