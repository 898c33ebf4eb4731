"""The table of performance indices: the meaning, unit and source of each, from `indices.toml`."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files
from tomllib import loads
from typing import Literal

from pteron.errors import DataError, ModelError
from pteron.manipulator import Manipulator, RobotLike, as_manipulator


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
    """

    name: str
    title: str
    formula: str
    source: str
    unit: str
    better: Literal["more", "less"]
    turning: bool = False
    moving: bool = True

    @property
    def label(self) -> str:
        """The title and, in brackets, the unit."""
        return f"{self.title} ({self.unit})" if self.unit else self.title


_TABLE = files("pteron.indices") / "indices.toml"

INDICES = {
    name: Index(name, **keys) for name, keys in loads(_TABLE.read_text(encoding="utf-8")).items()
}
"""The indices by name."""


def indices_of(robot: RobotLike) -> tuple[str, ...]:
    """Return the names of the indices that a machine has: those of what its platform does.

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
    return tuple(index.name for index in INDICES.values() if not _missing_motion(robot, index))


def _missing_motion(robot: Manipulator, index: Index) -> str:
    """Return the motion that an index asks for and a platform lacks, in words; or nothing."""
    if index.turning and not robot.platform.angles:
        return "turning, but this {} platform does not turn"
    if index.moving and not robot.platform.lengths:
        return "translation, but this {} platform only turns"
    return ""


def expect_index(robot: RobotLike, name: str) -> Index:
    """Return the index of that name, or refuse one that does not exist or suit the machine."""
    robot = as_manipulator(robot)
    if name not in INDICES:
        raise DataError(f"index: {name!r} is not known; choose from {', '.join(INDICES)}")
    index = INDICES[name]
    if missing := _missing_motion(robot, index):
        raise ModelError(
            f"index: {name!r} is about {missing.format(robot.platform.motion)}; choose from "
            f"{', '.join(indices_of(robot))}",
            subject=robot.name,
        )
    return index
