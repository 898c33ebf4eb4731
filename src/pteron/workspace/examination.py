"""A machine at its home pose, and all that is possible but unlikely of it.

`pteron check` and the report state the same warnings.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from pteron.kernels import Array
from pteron.kinematics.architecture import Architecture, architecture
from pteron.kinematics.constraints import constraint_measure
from pteron.manipulator import Manipulator
from pteron.manipulator.machine_warnings import machine_warnings
from pteron.workspace.holding import Holding, holding_warnings, measure_holding
from pteron.workspace.leg_layout import layout_warnings
from pteron.workspace.load_warnings import load_warnings
from pteron.workspace.mode_places import ModePlace, mode_places, mode_warnings
from pteron.workspace.screw_lengths import screw_warnings

_TILTS = (
    "legs: parallel rods whose bars turn on hinges of their own leave the platform free to tilt in "
    "every pose (constraint singularity): do legs share their hinges?"
)

_LEAST_CONSTRAINT = 0.01
"""Constraint measure at home below which the legs' couples do not hold the platform: then an error
of a direction of 10 mrad lets it turn."""


@dataclass(frozen=True)
class Examination:
    """A machine's measures at its home pose, its working modes, and warnings.

    Attributes
    ----------
    holding : Holding
        How the drives hold the platform.
    architecture : Architecture
        Whether the legs hold the platform's orientation, and its self-motions.
    modes : tuple of ModePlace
        Where the platform is in each working mode.
    warnings : tuple of str
        What is possible but unlikely, a line each.
    """

    holding: Holding
    architecture: Architecture
    modes: tuple[ModePlace, ...]
    warnings: tuple[str, ...]


def _constraint_warnings(robot: Manipulator, home: Array) -> Iterator[str]:
    """Yield a warning if the legs' couples leave the platform a turn at its home pose (m,)."""
    if any(leg.couples_vary for leg in robot.legs):
        measure = abs(float(constraint_measure(robot, home)))
        if not measure > _LEAST_CONSTRAINT:
            yield (
                "legs: at home their couples leave the platform free to turn (constraint "
                f"singularity): measure {measure:.2g}, above {_LEAST_CONSTRAINT:g} expected; turn "
                "a leg's direction, as from radial to tangential"
            )


def examine(robot: Manipulator, home: Array) -> Examination:
    """Return a machine's measures, working modes and warnings at its home pose (m,)."""
    measures, layout = measure_holding(robot, home), architecture(robot)
    modes = mode_places(robot, home)
    warnings = (
        *machine_warnings(robot),
        *((_TILTS,) if layout.holds is False else ()),
        *_constraint_warnings(robot, home),
        *layout_warnings(robot, home),
        *holding_warnings(measures),
        *mode_warnings(modes),
        *load_warnings(robot, home),
        *screw_warnings(robot),
    )
    return Examination(measures, layout, modes, warnings)
