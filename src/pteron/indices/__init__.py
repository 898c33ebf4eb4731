"""How good a machine is at a pose: indices of performance, stiffness, errors and reactions."""

from pteron.indices.evaluate import evaluate
from pteron.indices.index import INDICES, Index, indices_of
from pteron.indices.reactions import Reactions, reactions

__all__ = [
    "INDICES",
    "Index",
    "Reactions",
    "evaluate",
    "indices_of",
    "reactions",
]


def __dir__() -> list[str]:
    return sorted(__all__)
