"""Measurements of machines whose true geometry is known."""

from __future__ import annotations

import numpy as np

import pteron
from pteron.calibration import TOLERANCES
from pteron.equations.variations import variations, vary_geometry
from pteron.workspace.margins import distance_to_limits

NOISE = 2e-5
"""m and rad."""


def built(robot, seed=0, share=1.0):
    """Return a machine as it may be built: every value off by a share of its tolerance."""
    rng = np.random.default_rng(seed)
    ways = variations(robot)
    return vary_geometry(
        robot, ways, share * rng.normal(0.0, [TOLERANCES[way.group] for way in ways])
    )


def positions(robot, true, count, seed=1):
    """Return readings (N, n) of poses and the poses (N, m) as an instrument measures them."""
    rng = np.random.default_rng(seed)
    poses = pteron.random_poses(robot, 10 * count, seed=seed)
    poses = poses[distance_to_limits(robot, poses).min(axis=-1) > 0.01][:count]
    return pteron.inverse_kinematics(true, poses), poses + rng.normal(0.0, NOISE, poses.shape)
