"""`PteronVectorEnv`: many machines as one Gymnasium environment, stepped together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, get_args

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from pteron.arguments import checked_arguments, expect_one_of
from pteron.environments.construction import world_of
from pteron.environments.device_world import device_world
from pteron.environments.environment import Numbers, checked_mode, spaces
from pteron.environments.picture import EnvironmentPicture
from pteron.environments.state import Bools, EpisodeState
from pteron.errors import DataError
from pteron.kernels.loops import Device
from pteron.manipulator import RobotLike, as_manipulator
from pteron.motion import Machines, Motion

Tensors = Literal["torch", "cupy", "jax"]
"""A library of arrays on a GPU."""


@checked_arguments
class PteronVectorEnv(VectorEnv[Numbers, Numbers, Numbers]):
    """Many environments like `PteronEnv`, whose machines go on in one call.

    Each has its own random numbers: environment i of seed s is the single environment of seed
    s + i, step for step. An environment that has ended starts anew with the next step, whose action
    is not used (Gymnasium's next-step autoreset).

    Parameters
    ----------
    robot, motion, period, spread, tolerance, render_mode
        As `PteronEnv` has them.
    num_envs : int
        Number of environments.
    max_episode_steps : int, optional
        Steps after which an episode is truncated.
    machines : Machines, optional
        The machine of each environment (domain randomisation), `num_envs` of them, such as
        `pteron.motion.machines_about` draws: their masses, friction and payload differ.
    device : {"cpu", "cuda"}
        The processor, or an NVIDIA GPU: there states, observations, rewards and resets stay, and
        episodes are those of the processor. Actions are float32; `infos` have no "stopped":
        `end_reason` returns it.
    tensors : {"torch", "cupy", "jax"}
        The library of the GPU's results, which share memory with the environment.

    Raises
    ------
    DataError, ModelError
        As `PteronEnv`, or if there is no environment, or no GPU or library.

    Examples
    --------
    >>> import gymnasium, pteron.environments
    >>> envs = gymnasium.make_vec("pteron/Reach-v0", num_envs=8, robot="five-bar")
    >>> observations, infos = envs.reset(seed=1)
    >>> envs.step(envs.action_space.sample())[0].shape
    (8, 8)
    """

    metadata = {  # noqa: RUF012
        "render_modes": ["rgb_array"],
        "render_fps": 100,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        robot: RobotLike = "quadrupteron",
        num_envs: int = 1,
        *,
        motion: Motion | None = None,
        period: float = 0.01,
        spread: float | None = None,
        tolerance: float | None = None,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        machines: Machines | None = None,
        device: Device = "cpu",
        tensors: Tensors = "torch",
    ) -> None:
        expect_one_of(get_args(Device), device=device)
        expect_one_of(get_args(Tensors), tensors=tensors)
        for name, number in {"num_envs": num_envs, "max_episode_steps": max_episode_steps}.items():
            if number is not None and number < 1:
                raise DataError(f"{name}: {number} given, 1 or more expected")
        machine = as_manipulator(robot)
        if machines is not None and (len(machines) != num_envs or machines.robot != machine):
            raise DataError(
                f"machines: {len(machines)} of {machines.robot.name} given, {num_envs} of "
                f"{machine.name} expected, one for each environment"
            )
        self.world = world_of(
            machine,
            motion=motion,
            period=period,
            spread=spread,
            tolerance=tolerance,
            machines=machines,
        )
        self._picture = EnvironmentPicture(self.world)
        if device == "cuda":
            self.world = device_world(self.world, tensors)
        self.num_envs, self._device, self._tensors = num_envs, device, tensors
        pair = spaces(self.world.bounds, len(self.world.forces))
        self.single_observation_space, self.single_action_space = pair
        self.observation_space, self.action_space = (batch_space(space, num_envs) for space in pair)
        self.render_mode = checked_mode(render_mode)
        self.metadata = {**self.metadata, "render_fps": max(1, round(1.0 / period))}
        self._most = max_episode_steps
        self._generators = self.world.generators(num_envs)
        self._state: EpisodeState | None = None
        self._done = self.world.array(np.zeros(num_envs, dtype=bool))
        self._steps = self.world.array(np.zeros(num_envs, dtype=np.int64))

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Numbers, dict[str, Any]]:
        """Start all episodes, or those of a mask; return observations (E, 4 m) and infos.

        The option "reset_mask", a bool array, chooses the environments to reset; other options are
        those of `PteronEnv.reset`, the same for all.
        """
        options = dict(options or {})
        chosen = self._mask(options.pop("reset_mask", None))
        seeds = self._seeds(seed)
        is_first = self._state is None
        rows = [i for i in np.flatnonzero(chosen).tolist() if is_first or seeds[i] is not None]
        self._generators.put(rows, [seeding.np_random(seeds[i])[0] for i in rows])
        known = self.world.array(chosen)
        self._start(known, options)
        assert self._state is not None
        infos = self._infos(self.world.distance(self._state), known)
        return self._tensor(self.world.observations(self._state)), infos

    def _tensor(self, array: Any) -> Any:
        """Return an array as the user is given it."""
        return self.world.tensor(array, self._tensors)

    def _mask(self, mask: Any) -> Bools:
        """Return the checked mask (E,) of environments to reset; all if `mask` is None."""
        if mask is None:
            return np.ones(self.num_envs, dtype=bool)
        chosen = np.asarray(mask.get() if hasattr(mask, "get") else mask)
        if chosen.shape != (self.num_envs,) or chosen.dtype != bool or not chosen.any():
            raise DataError(
                f"options: reset_mask must be {self.num_envs} truth values, at least one True"
            )
        if self._state is None and not chosen.all():
            raise DataError("options: reset_mask before the first reset; reset all first")
        return chosen

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        """Return a seed for each environment: consecutive from an integer; None means random."""
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, np.ndarray):
            seed = seed.tolist()
        if isinstance(seed, int | np.integer):
            return [int(seed) + i for i in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise DataError(f"seed: {len(seed)} seeds given, {self.num_envs} expected")
        return [None if number is None else int(number) for number in seed]

    def _start(self, chosen: Bools, options: dict[str, Any] | None) -> None:
        """Start new episodes in the chosen environments; the others are unchanged."""
        rows = np.flatnonzero(chosen)
        numbers = self._generators.random(rows, self.world.number_count)
        new = self.world.episodes_from(numbers, options)
        self._state = new if self._state is None else self._state.put(rows, new)
        self._done = self._done & ~chosen
        self._steps = np.where(chosen, 0, self._steps)

    def step(self, actions: Numbers) -> tuple[Numbers, Numbers, Numbers, Numbers, dict[str, Any]]:
        """Apply actions (E, n) for one period.

        Return observations, rewards, end flags and infos. Environments that start a new episode are
        not advanced.
        """
        if self._state is None:
            raise DataError("step before reset; call reset first")
        starting = self._done
        last_state = self._state
        self._state, distance, reward, ended = self.world.advance(last_state, actions)
        self._steps = self._steps + 1
        if starting.any():
            self._start(starting, None)
            distance = np.where(starting, self.world.distance(self._state), distance)
        reward = np.where(starting, 0.0, reward)
        ended = ended & ~starting
        late = np.zeros_like(ended) if self._most is None else (self._steps >= self._most)
        late = late & ~starting
        self._done = ended | late
        infos = self._infos(distance, np.ones_like(ended))
        if self._device == "cpu" and ended.any():
            reasons = np.full(self.num_envs, None, dtype=object)
            for i in np.flatnonzero(ended).tolist():
                reasons[i] = self.end_reason(i)
            infos |= {"stopped": reasons, "_stopped": ended.copy()}
        arrays = self.world.observations(self._state), reward, ended, late
        observations, reward, ended, late = map(self._tensor, arrays)
        return observations, reward, ended, late, infos

    def _infos(self, distance: NDArray[Any], known: Bools) -> dict[str, Any]:
        """Return the infos of gymnasium's vector API: distance, success, and masks where known."""
        infos = {
            "distance": np.where(known, distance, 0.0),
            "_distance": known.copy(),
            "is_success": (distance < self.world.tolerance) & known,
            "_is_success": known.copy(),
        }
        return {name: self._tensor(array) for name, array in infos.items()}

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return a picture (height, width, 3) of every machine; None without a render mode."""
        if self.render_mode is None:
            return None
        if self._state is None:
            raise DataError("render before reset; call reset first")
        states = self.world.host_state(self._state)
        return tuple(self._picture.render(states.row(i)) for i in range(self.num_envs))

    def end_reason(self, i: int) -> str:
        """Return as text why the episode of environment i ended with the last step."""
        if self._state is None:
            raise DataError("end_reason before reset; call reset first")
        state = self.world.host_state(self._state.row(i))
        return self._picture.world.end_reason(state.pose, state.velocity)
