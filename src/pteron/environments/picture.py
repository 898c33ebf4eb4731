"""Pictures of an environment's machine as arrays of pixels."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pteron.environments.state import EpisodeState
from pteron.environments.world import World
from pteron.kernels import Array
from pteron.motion import Guide, joint_guides, joint_points
from pteron.plots import robot_figure
from pteron.plots.canvas import pixels
from pteron.plots.machine_figures import gravity_of

_POSES = 32
"""Random poses that the sliders' guides must reach, which sets the length that is drawn."""


class EnvironmentPicture:
    """The picture of one machine, drawn anew for each state: its guides are the same in all."""

    def __init__(self, world: World) -> None:
        self.world = world

    @cached_property
    def _guides(self) -> tuple[Guide, ...]:
        """The paths of the machine's actuated joints, over random poses."""
        generators = [np.random.default_rng(seed) for seed in range(_POSES)]
        return joint_guides(self.world.robot, self.world.start_episodes(generators, None).pose)

    def render(self, state: EpisodeState) -> NDArray[np.uint8]:
        """Return pixels (height, width, 3) of the machine in a state, with a line to its target.

        All pictures have the size of the picture with the machine at home.
        """
        figure = self._drawn(state.pose, self.world.target(state)[0])
        figure.set_size_inches(self._size)
        return pixels(figure)

    @cached_property
    def _size(self) -> tuple[float, float]:
        """Width and height of the figure with the machine at home, in inches."""
        width, height = self._drawn(self.world.home, self.world.home).get_size_inches()
        return float(width), float(height)

    def _drawn(self, pose: Array, target: Array) -> Figure:
        """Return the figure of the machine at a pose (m,), with a line from tool to target."""
        robot = self.world.robot
        points = joint_points(robot, pose)
        figure = robot_figure(
            points,
            self._guides,
            gravity=gravity_of(robot),
            path=np.array([points.tool, joint_points(robot, target).tool]),
        )
        figure.patch.set(facecolor="white", alpha=1.0)
        return figure
