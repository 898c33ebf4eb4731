"""A machine with its drives, simulated under a controller, under given forces, or free."""

from pteron.motion.simulation.loop import Law
from pteron.motion.simulation.plant import advance, longest_step
from pteron.motion.simulation.result import Simulation
from pteron.motion.simulation.sensors import Sensors
from pteron.motion.simulation.simulate import Controls, simulate

__all__ = [
    "Controls",
    "Law",
    "Sensors",
    "Simulation",
    "advance",
    "longest_step",
    "simulate",
]


def __dir__() -> list[str]:
    return sorted(__all__)
