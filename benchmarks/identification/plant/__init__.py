"""A simulated machine that is not Pteron's model, and the sensors that watch it."""

from plant.built import as_built
from plant.friction import Friction
from plant.inverse import State, platform_state
from plant.machine import Recording, simulate
from plant.reference import Fourier, Reference, fourier_reference
from plant.sensors import Log, measured

__all__ = [
    "Fourier",
    "Friction",
    "Log",
    "Recording",
    "Reference",
    "State",
    "as_built",
    "fourier_reference",
    "measured",
    "platform_state",
    "simulate",
]
