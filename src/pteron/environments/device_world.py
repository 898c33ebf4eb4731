"""The world of a Gymnasium environment on an NVIDIA GPU: states, rewards and starts stay there."""

from __future__ import annotations

from dataclasses import fields
from functools import cached_property, lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from pteron.environments.state import Bools, EpisodeState
from pteron.environments.world import World
from pteron.errors import ModelError
from pteron.kernels import Array
from pteron.kernels.choice import kernel_with_status
from pteron.kernels.cuda import DeviceKernel, convert_to_library, device_library, move_to_device
from pteron.kernels.device_random import DeviceGenerators
from pteron.kernels.loops import loop
from pteron.manipulator import Manipulator
from pteron.motion.motion import interpolate
from pteron.motion.simulation.plant import advance_states, drive_states


class DeviceWorld(World):
    """A `World` whose arrays are on a GPU.

    Functions of NumPy act on CuPy's arrays there; what the machine does, and its random numbers,
    are computed by kernels with the bits of the processor's.
    """

    def array(self, numbers: Any) -> Any:
        """Return numbers as a CuPy array."""
        return device_library().asarray(numbers)

    def tensor(self, array: Any, library: str) -> Any:
        """Return a CuPy array as one of a library, "cupy", "torch" or "jax", in the same memory."""
        return convert_to_library(array, library)

    def host_state(self, state: EpisodeState) -> EpisodeState:
        """Return a state in NumPy's arrays."""
        return EpisodeState(*(np.array(getattr(state, part.name).get()) for part in fields(state)))

    def generators(self, count: int) -> DeviceGenerators:
        """Return `count` random generators, to be put."""
        return DeviceGenerators(count)

    def _kernel(self, what: str) -> Any:
        """Return the kernel of a function of the machine, by name."""
        return _device_kernel(self.robot, what)

    @cached_property
    def _samples(self) -> tuple[Array, Array, Array, Array]:
        """The motion's times, poses, velocities and accelerations."""
        assert self.motion is not None
        parts = self.motion.time, self.motion.pose, self.motion.velocity, self.motion.acceleration
        time, pose, velocity, acceleration = map(self.array, parts)
        return time, pose, velocity, acceleration

    def _reference(self, clock: Array) -> tuple[Array, Array]:
        """Return pose and velocity (..., m) of the motion at times (...) since its begin, s."""
        return interpolate(self._samples, self._samples[0][0] + clock)[:2]

    def _drive_states(self, pose: Any, velocity: Any) -> Any:
        """Return the states (..., K) of drives that bend or lag, which the host computes."""
        if not loop(self.robot).kind.extra_states:
            return np.zeros_like(pose, shape=(len(pose), 0))
        return self.array(drive_states(self.robot, pose.get(), velocity.get()))

    @cached_property
    def _numbers(self) -> dict[str, Array]:
        """The numbers of the machines, where they differ."""
        numbers = {} if self.machines is None else self.machines.numbers
        return {name: self.array(array) for name, array in numbers.items()}

    def _advance(self, state: EpisodeState, forces: Array) -> tuple[Array, Array, Array, Bools]:
        """Return pose, velocity and drives of machines after a period, and which can go on."""
        simulator = loop(
            self.robot, general=self.machines is not None and self.machines.geometry is not None
        )
        columns = np.concatenate([state.pose, state.velocity, state.drives], axis=-1)[:, None]
        arrays = {"given": forces[:, None], **self._numbers}
        span = self.step, self.count
        rows, going = advance_states(simulator, self.robot, columns, arrays, *span, device="cuda")
        m = self.robot.freedom
        return rows[:, 0, :m], rows[:, 0, m : 2 * m], rows[:, 0, 2 * m :], going

    def _action_array(self, action: Any) -> Array:
        """Return an action, of float32, as an array of double precision."""
        array: Array = move_to_device(action, "action", "float32").astype(np.float64)
        return array


def device_world(world: World, library: str) -> DeviceWorld:
    """Return a world on the GPU; raise ModelError if there is none, or no such library."""
    device_library()
    try:
        import_module(library)
    except ImportError:
        raise ModelError(
            f'tensors: {library!r} is not installed; install it, or give tensors="cupy"'
        ) from None
    return DeviceWorld(**{part.name: getattr(world, part.name) for part in fields(world)})


@lru_cache(maxsize=256)
def _device_kernel(robot: Manipulator, what: str) -> DeviceKernel:
    """Return the GPU's kernel of a function of a machine, cached in this process."""
    kernel = kernel_with_status(robot, what, DeviceKernel)
    assert isinstance(kernel, DeviceKernel)
    return kernel
