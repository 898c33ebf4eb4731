from pteron.maps.files import load_map as load_map, save_map as save_map
from pteron.maps.grid import Axis as Axis, Grid as Grid, pose_grid as pose_grid
from pteron.maps.map import Map as Map, Summary as Summary
from pteron.maps.map_index import map_index as map_index
from pteron.maps.surfaces import Surface as Surface, surfaces as surfaces
from pteron.maps.sweep import Store as Store, cores as cores, sweep as sweep
from pteron.maps.table_store import TableStore as TableStore
