"""The law of a controller for one machine: a function called at every sample for the forces."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from pteron.equations.control import ADAPTED, GAINS, MEMORY, Layout, estimate_count, lengths
from pteron.equations.drives import drive_names
from pteron.errors import DataError
from pteron.kernels import Array, Program, as_array, columns_of, numeric, program
from pteron.kernels.choice import TieredKernel
from pteron.kernels.loops import machine_numbers
from pteron.manipulator import Manipulator
from pteron.reduction import BaseParameters
from pteron.shapes import JointsLike, PerJoint, PoseLike


@dataclass(frozen=True)
class Law:
    """A control law with gains and the model of one machine; its state is passed in and returned.

    Attributes
    ----------
    what : str
        Name of the law, one of `pteron.kernels.FUNCTIONS`.
    model : Manipulator
        The machine as the controller knows it.
    gains : array, shape (G,)
        The gains, in the order of `gain_names`, SI units.
    base : BaseParameters, optional
        The base parameters that an adaptive law estimates.

    Examples
    --------
    >>> import numpy as np, pteron
    >>> from pteron.controllers import ComputedTorque
    >>> robot, rest = pteron.load("tripteron"), np.zeros(3)
    >>> law = ComputedTorque().law(robot)
    >>> joints = pteron.inverse_kinematics(robot, rest)
    >>> forces, memory = law(rest, rest, rest, joints, rest, law.memory(rest, rest))
    >>> np.allclose(forces, pteron.inverse_dynamics(robot, rest, rest, rest))
    True
    """

    what: str
    model: Manipulator
    gains: Array = field(repr=False)
    base: BaseParameters | None = field(default=None, repr=False)

    def memory(self, pose: PoseLike, velocity: PoseLike) -> Array:
        """Return the control law's memory (..., K) before the first sample.

        Parameters
        ----------
        pose, velocity : array, shape (..., m)
            The state, m, rad and s. The pose may be some millimetres from that of the joints. The
            wanted acceleration before the first sample is taken as zero.

        Returns
        -------
        array, shape (..., K)
        """
        robot = self.model
        place, rate = (
            as_array(coordinates, name, (robot.freedom,), columns=robot.column_names[name])
            for name, coordinates in (("pose", pose), ("velocity", velocity))
        )
        place = np.broadcast_arrays(place, rate)[0]
        zeros = [
            np.zeros((*place.shape[:-1], size)) if name != "measured" else place
            for name, size in self._sizes(MEMORY).items()
        ]
        return np.concatenate(zeros, axis=-1)

    def __call__(
        self,
        pose: PoseLike,
        velocity: PoseLike,
        acceleration: PoseLike,
        joints: JointsLike,
        joint_rates: JointsLike,
        memory: Array,
    ) -> tuple[PerJoint, Array]:
        """Return drive forces (..., n) until the next sample, and the memory (..., K) for it.

        Parameters
        ----------
        pose, velocity, acceleration : array, shape (..., m)
            The platform's motion that is wanted at this sample; m, rad and s. Leading axes
            broadcast.
        joints, joint_rates : array, shape (..., n)
            The measured state of the joints: m and m/s at a slider, rad and rad/s at a crank, as
            `inverse_kinematics` gives them.
        memory : array, shape (..., K)
            The memory that the call at the last sample, or `memory`, returned.

        Returns
        -------
        forces : array, shape (..., n)
            Forces of the drives, N at a slider, N m at a crank. NaN where a leg does not reach the
            wanted pose, where that is singular, or Newton's method finds no pose for the joints.
        memory : array, shape (..., K)
        """
        reference = pose, velocity, acceleration
        forces, next_memory, status = self._kernel(
            *reference, joints, joint_rates, memory, self.gains
        )
        if not status.all():
            forces[status == 0.0] = np.nan
        return forces, next_memory

    @cached_property
    def program(self) -> Program:
        """The control law as a program, for `pteron.kernels.loops.Loop`."""
        columns = None if self.base is None else columns_of(self.base)
        return program(self.model, self.what, columns, guarded=True)

    @property
    def numbers(self) -> dict[str, Array]:
        """The gains and model parameters as arrays by name, for `pteron.kernels.loops.Loop.run`."""
        model_numbers = machine_numbers(self.model, self.program, "law")
        return model_numbers | {"law_gains": self.gains.reshape(1, 1, -1)}

    @cached_property
    def _kernel(self) -> TieredKernel:
        """The compiled kernel of the control law."""
        return numeric(self.model, self.what, base=self.base)

    def estimates(self, memory: Array) -> Array:
        """Return an adaptive law's estimated parameters (..., E) from its memory (..., K).

        Parameters
        ----------
        memory : array, shape (..., K)
            The memory that the law returned.

        Returns
        -------
        array, shape (..., E)
            In the order of `base.names`, SI units; then motors' inertia, dry friction, viscous
            friction and offset, each for all joints.

        Raises
        ------
        DataError
            If the law estimates nothing.
        """
        if self.base is None:
            raise DataError(f"{self.what}: it estimates nothing; use Adaptive")
        gains = self._parts(GAINS, self.gains)
        learnt = self._parts(MEMORY, memory)["learnt"]
        count = learnt.shape[-1]
        matrix = gains["learning"].reshape(count, count).T  # CasADi has columns
        return np.asarray(gains["start"] + learnt @ matrix.T)

    @property
    def gain_names(self) -> tuple[str, ...]:
        """Names of the gain vector's elements: "proportional_1" for joint 1, and so on."""
        joints = range(1, self.model.joint_count + 1)
        estimates: tuple[str, ...] = () if self.base is None else self.base.names
        if self.what == "adaptive_drives":
            estimates += drive_names(self.model)[: len(ADAPTED) * self.model.joint_count]
        names: list[str] = []
        for name, per in GAINS[self.what].items():
            if per == "joint":
                names += [f"{name}_{i}" for i in joints]
            elif per == "parameter":
                names += [f"{name}: {estimate}" for estimate in estimates]
            elif per == "pair":
                count = range(1, len(estimates) + 1)
                names += [f"{name}: {estimate}, {k}" for k in count for estimate in estimates]
            else:
                names.append(name)
        return tuple(names)

    def _sizes(self, layout: Layout) -> dict[str, int]:
        """Return the length of each named part of the law's gain or memory vector."""
        freedom, joints = self.model.freedom, self.model.joint_count
        inertial = 0 if self.base is None else self.base.selection.shape[1]
        estimates = estimate_count(self.what, joints, inertial)
        return lengths(layout[self.what], freedom, joints, estimates)

    def _parts(self, layout: Layout, vector: Array) -> dict[str, Array]:
        """Return the named parts (..., k) of a gain or memory vector (..., K)."""
        sizes = self._sizes(layout)
        bounds = np.cumsum(list(sizes.values()))[:-1]
        return dict(zip(sizes, np.split(vector, bounds, axis=-1), strict=True))
