"""How good a machine is at a pose: indices of performance, stiffness, errors and reactions."""

from pteron.indices.elasticity import ALUMINIUM, STEEL, Elasticity, Material, Section
from pteron.indices.evaluate import evaluate
from pteron.indices.index import INDICES, Index, indices_of
from pteron.indices.reactions import Reactions, reactions
from pteron.indices.stiffness import Stiffness, stiffness

__all__ = [
    "ALUMINIUM",
    "INDICES",
    "STEEL",
    "Elasticity",
    "Index",
    "Material",
    "Reactions",
    "Section",
    "Stiffness",
    "evaluate",
    "indices_of",
    "reactions",
    "stiffness",
]


def __dir__() -> list[str]:
    return sorted(__all__)
