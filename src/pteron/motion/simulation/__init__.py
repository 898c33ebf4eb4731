"""A machine with its drives, simulated under a controller, under given forces, or free."""

from typing import TYPE_CHECKING

from pteron.motion.simulation.loop import ControlLaw
from pteron.motion.simulation.plant import advance, longest_step
from pteron.motion.simulation.sensors import Sensors
from pteron.motion.simulation.simulate import Controls, simulate
from pteron.motion.simulation.simulation import Simulation
from pteron.renamed import former_names

__all__ = ["Controls", "ControlLaw", "Sensors", "Simulation", "advance", "longest_step", "simulate"]

if not TYPE_CHECKING:
    __getattr__ = former_names(__name__)


def __dir__() -> list[str]:
    return sorted(__all__)


if not TYPE_CHECKING:
    __getattr__ = former_names(__name__)
