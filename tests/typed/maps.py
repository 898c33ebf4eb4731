"""An index of one's own over the workspace, beside one of Pteron's."""

import numpy as np
from numpy.typing import NDArray

import pteron
from pteron.indices import Index
from pteron.maps import Map, map_index, pose_grid


def lever(robot: pteron.Manipulator, poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of each pose from the axis, m."""
    return np.hypot(poses[:, 0], poses[:, 1])


far = Index("lever", "distance from the axis", unit="m", better="less", function=lever)
index_map: Map = map_index("delta", ["condition", far], pose_grid("delta", {"y": 0.0}, points=9))
best: float = index_map.statistics("lever").best
print(index_map.units, round(best, 3), index_map.table().height)
