"""Objectives of a user's own, in a module that other processes can import."""

import multiprocessing
import os

import numpy as np


def crank_area(robot):
    """Sum of the squares of all links, m^2."""
    return sum(leg.upper_length**2 + leg.lower_length**2 for leg in robot.legs)


def widest_pose(design):
    """Largest coordinate of a sampled pose, m."""
    return float(np.abs(design.poses).max())


def ends_its_process(robot):
    """An objective that ends the process that evaluates it, unless that is the caller's."""
    if multiprocessing.parent_process() is not None:
        os._exit(1)
    return 1.0
