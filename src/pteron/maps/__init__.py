"""Work on many poses, or many designs: in chunks, here or on a cluster, and never twice."""

from pteron.maps.sweep import Store, cores, sweep
from pteron.maps.table_store import TableStore

__all__ = ["Store", "TableStore", "cores", "sweep"]


def __dir__() -> list[str]:
    return sorted(__all__)
