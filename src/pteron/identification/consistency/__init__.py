"""Real bodies for identified base parameters: masses above zero, inertias that a body can have."""

from pteron.identification.consistency.bodies import real_bodies
from pteron.identification.consistency.bounds import Bounds
from pteron.identification.consistency.cones import MissingSolver
from pteron.identification.consistency.consistency import Consistency
from pteron.identification.consistency.consistent_model import consistent_model

__all__ = ["Bounds", "Consistency", "MissingSolver", "consistent_model", "real_bodies"]


def __dir__() -> list[str]:
    return sorted(__all__)
