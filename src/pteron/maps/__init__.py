"""Maps of performance indices over grids of poses, and sweeps of any function over many chunks.

Work is done in chunks, here or on a cluster; a chunk that is stored is not computed again.
"""

from typing import TYPE_CHECKING

from pteron.public import publish as _publish

if TYPE_CHECKING:
    from pteron.maps.files import load_map as load_map, save_map as save_map
    from pteron.maps.grid import Axis as Axis, Grid as Grid, pose_grid as pose_grid
    from pteron.maps.map import Map as Map, Summary as Summary
    from pteron.maps.map_index import map_index as map_index
    from pteron.maps.surfaces import Surface as Surface, surfaces as surfaces
    from pteron.maps.sweep import Store as Store, cores as cores, sweep as sweep
    from pteron.maps.table_store import TableStore as TableStore

_publish(__name__, checked=True)
