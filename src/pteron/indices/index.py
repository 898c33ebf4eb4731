"""The table of performance indices: the meaning, unit and source of each, from `indices.toml`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files
from tomllib import loads
from typing import Any, Literal

import numpy as np

from pteron.errors import DataError, ModelError, shorten
from pteron.extensions import extension_names, extension_value, load_extension
from pteron.kernels import Array
from pteron.manipulator import Manipulator, RobotLike, as_manipulator

GROUP = "pteron.indices"
"""The group of entry points by which installed packages add indices."""


@dataclass(frozen=True)
class Index:
    """One index of performance.

    Attributes
    ----------
    name : str
        As `evaluate` takes it.
    title : str
        As a picture's colour bar says it, without the unit.
    formula : str
        In LaTeX, in the letters of the documentation's page on indices.
    source : str
        Who defined it.
    unit : str
        Empty for a plain number.
    better : {"more", "less"}
        Whether more or less of it is better.
    turning : bool
        Whether it measures rotation: only platforms with an angle have it.
    moving : bool
        Whether it measures translation: only platforms with a length have it.
    single : bool
        Whether it moves one joint while the others are held: only machines with as many legs as
        freedoms have it.
    function : callable, optional
        Of an index that is not Pteron's own: returns its values (N,) from a machine and poses
        (N, m), all of them in reach.

    Examples
    --------
    >>> from pteron.indices import Index, evaluate
    >>> height = Index("height", "height", unit="m", function=lambda robot, poses: poses[:, 2])
    >>> evaluate("tripteron", height, [[0.0, 0.1, 0.05]])
    array([0.05])
    """

    name: str
    title: str
    formula: str = ""
    source: str = ""
    unit: str = ""
    better: Literal["more", "less"] = "more"
    turning: bool = False
    moving: bool = True
    single: bool = False
    function: Callable[[Manipulator, Array], Any] | None = None

    @property
    def label(self) -> str:
        """The index's title with its unit in brackets."""
        return f"{self.title} ({self.unit})" if self.unit else self.title


_TABLE = files("pteron.indices") / "indices.toml"

INDICES = {
    name: Index(name, **keys) for name, keys in loads(_TABLE.read_text(encoding="utf-8")).items()
}
"""The indices by name."""


def index_named(name: str) -> Index | None:
    """Return the performance index of this name, also from a package; None if unknown.

    Raises
    ------
    ModelError
        If the package that has it cannot be imported, or has no `Index` of that name there.
    """
    if name in INDICES:
        return INDICES[name]
    index = load_extension(GROUP, name)
    if index is not None and not (
        isinstance(index, Index) and index.name == name and callable(index.function)
    ):
        value = extension_value(GROUP, name)
        raise ModelError(f"{value} is no pteron.indices.Index {name!r} with a function")
    return index


def indices_of(robot: RobotLike) -> tuple[str, ...]:
    """Return the names of the performance indices that a machine has.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.

    Returns
    -------
    tuple of str

    Examples
    --------
    >>> from pteron.indices import indices_of
    >>> "turning_speed" in indices_of("tripteron"), "turning_speed" in indices_of("quadrupteron")
    (False, True)
    """
    robot = as_manipulator(robot)
    installed = (index_named(name) for name in extension_names(GROUP) if name not in INDICES)
    indices = [*INDICES.values(), *(index for index in installed if index is not None)]
    return tuple(index.name for index in indices if not _missing_motion(robot, index))


def _missing_motion(robot: Manipulator, index: Index) -> str:
    """Return a phrase on the motion that an index needs and the platform lacks, or ''."""
    if index.turning and not robot.platform.angles:
        return "turning, but this {} platform does not turn"
    if index.moving and not robot.platform.lengths:
        return "translation, but this {} platform only turns"
    if index.single and robot.redundancy:
        return "joints that move alone, but this {} platform has more legs than freedoms"
    return ""


def expect_index(robot: RobotLike, name: str | Index) -> Index:
    """Return the index of this name; raise if it does not exist or suit the machine."""
    robot = as_manipulator(robot)
    index = name if isinstance(name, Index) else index_named(name)
    if index is None:
        known = ", ".join(dict.fromkeys((*INDICES, *extension_names(GROUP))))
        raise DataError(f"index: {name!r} is not known; choose from {known}")
    if isinstance(name, Index):
        name = index.name
        if index.function is None and INDICES.get(name) != index:
            raise DataError(f"index: {name!r} has no function; give one of the machine and poses")
        if index.function is not None and name in INDICES:
            raise DataError(f"index: {name!r} is the name of an index of Pteron; choose another")
    if missing := _missing_motion(robot, index):
        raise ModelError(
            f"index: {name!r} is about {missing.format(robot.platform.motion)}; choose from "
            f"{', '.join(indices_of(robot))}",
            subject=robot.name,
        )
    return index


def function_values(robot: Manipulator, index: Index, poses: Array) -> Array:
    """Return the values (N,) of an index's own function at poses (N, m) in reach.

    Raises
    ------
    DataError
        If it returns something else than a real number for each pose.
    """
    assert index.function is not None
    returned = index.function(robot, poses)
    values = np.asarray(returned)
    if values.shape != (len(poses),) or values.dtype.kind not in "biuf":
        raise DataError(
            f"index {index.name!r}: its function returns {shorten(returned)}; an array of "
            f"{len(poses)} real numbers expected, one for each pose"
        )
    return values.astype(float)
