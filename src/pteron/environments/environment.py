"""`PteronEnv`: one machine as a Gymnasium environment."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from pteron.arguments import checked_arguments
from pteron.environments.construction import world_of
from pteron.environments.picture import EnvironmentPicture
from pteron.environments.state import EpisodeState
from pteron.errors import DataError
from pteron.kernels import Array
from pteron.manipulator import RobotLike
from pteron.motion import Motion

Numbers = NDArray[Any]
"""Arrays of observations and actions: float32."""


@checked_arguments
class PteronEnv(gymnasium.Env[Numbers, Numbers]):
    """A machine whose drives' forces are the actions, to reach a pose or to follow a motion.

    The action, (n,) in [-1, 1], is each drive's share of its greatest force, kept for a period. The
    observation, (4 m,), is the platform's pose and velocity and the target's, m, rad and s. An
    episode starts at rest in a random pose, or on the motion at a random time. It ends
    (`terminated`) where the machine leaves its reach, its joints' limits or the neighbourhood of
    its singularities, with the reason in ``info["stopped"]``; reaching the target does not end it.
    ``info["distance"]`` is in m, a radian counting as 0.1 m; ``info["is_success"]`` says whether it
    is within the tolerance.

    The reward of a step is 1 - tanh(2 distance / spread) - 0.01 mean(action^2), and -1 where the
    episode ends.

    Parameters
    ----------
    robot : Manipulator, name or path
        A machine of the catalog, a TOML file, or a machine. An action of 1 gives each
        drive's max_force, or enough to move briskly.
    motion : Motion, optional
        The motion to be followed, again and again; by default a random pose is to be reached.
    period : float
        Time of an action, s.
    spread : float, optional
        Half the side of the box about the home pose in which starts and targets are, m; by default
        a quarter of the longest leg's links. Along each coordinate it ends where the machine's
        travel does.
    tolerance : float, optional
        Distance that is a success, m; by default 5 mm, or a tenth of the way to the rim of the box
        where that is less.
    render_mode : {None, "rgb_array"}
        Whether `render` draws the machine.

    Raises
    ------
    DataError
        If a number is not above 0, the motion cannot be followed, or a mode is unknown.
    ModelError
        If there is no such machine, or it reaches no pose.

    Examples
    --------
    >>> import gymnasium, pteron.environments
    >>> env = gymnasium.make("pteron/Reach-v0", robot="five-bar")
    >>> observation, info = env.reset(seed=1)
    >>> env.action_space.shape, observation.shape, round(info["distance"], 3)
    ((2,), (8,), 0.013)
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 100}  # noqa: RUF012

    def __init__(
        self,
        robot: RobotLike = "quadrupteron",
        *,
        motion: Motion | None = None,
        period: float = 0.01,
        spread: float | None = None,
        tolerance: float | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.world = world_of(
            robot, motion=motion, period=period, spread=spread, tolerance=tolerance
        )
        self.observation_space, self.action_space = spaces(
            self.world.bounds, len(self.world.forces)
        )
        self.render_mode = checked_mode(render_mode)
        self.metadata = {**self.metadata, "render_fps": max(1, round(1.0 / period))}
        self._state: EpisodeState | None = None
        self._picture = EnvironmentPicture(self.world)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        """Start an episode; return the observation (4 m,) and infos."""
        super().reset(seed=seed)
        self._state = self.world.start_episodes([self.np_random], options).row(0)
        return self.world.observations(self._state), self._info(self.world.distance(self._state))

    def step(self, action: Numbers) -> tuple[Numbers, float, bool, bool, dict[str, Any]]:
        """Apply an action (n,) for one period; return observation, reward, end flags and infos."""
        if self._state is None:
            raise DataError("step before reset; call reset first")
        self._state, distance, reward, ended = self.world.advance(self._state, action)
        info = self._info(distance)
        if ended:
            info["stopped"] = self.world.end_reason(self._state.pose, self._state.velocity)
        return self.world.observations(self._state), float(reward), bool(ended), False, info

    def _info(self, distance: Any) -> dict[str, Any]:
        """Return a dictionary: the distance to the target, m, and if it is within tolerance."""
        return {"distance": float(distance), "is_success": bool(distance < self.world.tolerance)}

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture of the machine, (height, width, 3); None without a render mode."""
        if self.render_mode is None:
            return None
        if self._state is None:
            raise DataError("render before reset; call reset first")
        return self._picture.render(self._state)


def spaces(bounds: Array, count: int) -> tuple[gymnasium.Space[Any], gymnasium.Space[Any]]:
    """Return the gymnasium spaces of observations within +-bounds and of `count` actions."""
    most = bounds.astype(np.float32)
    return (
        gymnasium.spaces.Box(-most, most, dtype=np.float32),
        gymnasium.spaces.Box(-1.0, 1.0, (count,), dtype=np.float32),
    )


def checked_mode(mode: str | None) -> str | None:
    """Return a render mode; raise unless it is None or "rgb_array"."""
    if mode not in (None, "rgb_array"):
        raise DataError(f'render_mode: {mode!r} given, None or "rgb_array" expected')
    return mode
