"""How good a machine is at a pose: indices of performance, stiffness, errors and reactions."""

from pteron.indices.evaluate import evaluate
from pteron.indices.index import INDICES, Index, indices_of

__all__ = [
    "INDICES",
    "Index",
    "evaluate",
    "indices_of",
]


def __dir__() -> list[str]:
    return sorted(__all__)
