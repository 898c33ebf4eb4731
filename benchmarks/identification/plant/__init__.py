"""A simulated machine, by an engine that is not Pteron or by Pteron, and what its sensors see."""

from plant.built import as_built
from plant.friction import Friction
from plant.inverse import State, platform_state
from plant.machine import Plant, Recording, simulate
from plant.own import Own
from plant.reference import Fourier, Reference, fourier_reference
from plant.sensors import Log, measured

__all__ = [
    "Fourier",
    "Friction",
    "Log",
    "Own",
    "Plant",
    "Recording",
    "Reference",
    "State",
    "as_built",
    "fourier_reference",
    "measured",
    "platform_state",
    "simulate",
]
