"""Maps of indices over poses as NumPy archives (.npz): write, and read with a check for damage."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np

from pteron.atomic import write_bytes
from pteron.errors import DataError
from pteron.maps.checksums import checksum
from pteron.maps.grid import Grid
from pteron.maps.map import Map, own_attributes, own_indices_of

_ABOUT, _STATUS = "about", "status"
"""Names of two more arrays: grid, machine and units as JSON; whether each pose is in reach."""

_LONGEST_ABOUT = 1 << 24
"""Bytes of the longest description that is read."""

_HEADER, _WIDEST = 4096, 8
"""Bytes of an array's header and of its widest element."""


def write_archive(index_map: Map, target: Path) -> Path:
    """Write a map to an .npz file."""
    buffer = io.BytesIO()
    axes = {axis.name: axis.values for axis in index_map.grid.axes}
    arrays: dict[str, Any] = {**axes, **index_map.values, _STATUS: index_map.status}
    about: dict[str, Any] = {
        "robot": index_map.robot,
        "machine": index_map.machine,
        "units": index_map.units,
        "grid": index_map.grid.plain(),
    }
    if index_map.own_indices:
        about["own"] = {index.name: own_attributes(index) for index in index_map.own_indices}
    about["sha256"] = checksum(about, arrays)
    arrays[_ABOUT] = np.array(json.dumps(about))
    np.savez_compressed(buffer, **arrays)
    return write_bytes(target, buffer.getvalue())


def read_archive(source: Path) -> Map:
    """Return the map of an .npz file."""
    try:
        arrays = _arrays(source)
        about = json.loads(str(arrays.pop(_ABOUT)))
        given_sum = about.pop("sha256")
        if given_sum != checksum(about, arrays):
            raise ValueError("its checksum is another one")
        indices = {name: arrays[name] for name in about["units"]}
        grid = Grid.from_plain(about["grid"])
        own_indices = own_indices_of(about.get("own", {}))
        status, machine = arrays[_STATUS], about["machine"]
        return Map(about["robot"], grid, indices, status, machine, own_indices)
    except Exception as error:  # unpacking damaged bytes raises anything
        reason = str(error) if type(error) is ValueError else type(error).__name__
        raise DataError(
            f"{source}: is no map's archive, or is damaged ({reason}); save the map again"
        ) from None


def _expect_sizes_of_a_map(archive: ZipFile) -> None:
    """Raise ValueError if an archive's arrays would unpack to more than its grid has poses."""
    about = archive.getinfo(f"{_ABOUT}.npy")
    if about.file_size > _LONGEST_ABOUT:
        raise ValueError("its description is too long")
    text = np.lib.format.read_array(io.BytesIO(archive.read(about)), allow_pickle=False)
    described = json.loads(str(text))
    grid = Grid.from_plain(described["grid"])
    names = {*described["units"], _STATUS, *(axis.name for axis in grid.axes)}
    expected = {about.filename} | {f"{name}.npy" for name in names}
    if set(archive.namelist()) != expected or len(archive.namelist()) != len(expected):
        raise ValueError("its arrays are others than it describes")
    for member in archive.infolist():
        if member is not about and member.file_size > _HEADER + _WIDEST * grid.size:
            raise ValueError(f"{member.filename} is larger than its grid")


def _arrays(source: Path) -> dict[str, Any]:
    """Return the arrays of an archive, unpacked only after the archive's own checksums."""
    with ZipFile(source) as archive:
        _expect_sizes_of_a_map(archive)
        members = {name: archive.read(name) for name in archive.namelist()}
    return {
        name.removesuffix(".npy"): np.lib.format.read_array(io.BytesIO(content), allow_pickle=False)
        for name, content in members.items()
    }
