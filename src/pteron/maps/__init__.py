"""Maps of performance indices over grids of poses, and sweeps of any function over many chunks.

Work is done in chunks, here or on a cluster, and what is finished is never computed twice.
"""

from pteron.arguments import check_arguments
from pteron.maps.files import load_map, save_map
from pteron.maps.grid import Axis, Grid, pose_grid
from pteron.maps.map import Map, Summary
from pteron.maps.map_index import map_index
from pteron.maps.surfaces import Surface, surfaces
from pteron.maps.sweep import Store, cores, sweep
from pteron.maps.table_store import TableStore

__all__ = [
    "Axis",
    "Grid",
    "Map",
    "Store",
    "Summary",
    "Surface",
    "TableStore",
    "cores",
    "load_map",
    "map_index",
    "pose_grid",
    "save_map",
    "surfaces",
    "sweep",
]
check_arguments(__name__, classes=("Grid",))


def __dir__() -> list[str]:
    return sorted(__all__)
