"""
Singular orientations
=====================

At a type-II singularity the actuators, held still, no longer hold the platform. For a Quadrupteron
this depends on the orientation alone: there are two such angles, 180 degrees apart.
"""

import numpy as np

import pteron
from pteron.workspace import home_pose

robot = pteron.load("quadrupteron")
home = home_pose(robot)
angles = np.linspace(-np.pi, np.pi, 361)
poses = np.column_stack([np.tile(home[:3], (361, 1)), angles])
determinant = np.linalg.det(pteron.jacobian(robot, poses))
measure = np.abs(determinant) / np.abs(determinant).max()
singular = pteron.kinematics.singular_orientations(robot)
orientations = pteron.plots.regularity_figure(angles, measure, singular, home=home[3])

# %%
# For a planar 3-RRR it depends on the position too. On either side of the red line det J has
# another sign: no motion leads from + to - but through a singularity.
planar = pteron.load("3-rrr")
x, phi = np.linspace(-0.15, 0.15, 151), np.linspace(-np.pi, np.pi, 241)
grid = np.zeros((len(phi), len(x), 3))
grid[..., 0], grid[..., 2] = np.meshgrid(x, phi)
with np.errstate(invalid="ignore"):
    signed = np.linalg.det(pteron.jacobian(planar, grid, on_failure="nan"))
loci = pteron.plots.singularities_figure(x, phi, signed, names=("x", "phi"))
