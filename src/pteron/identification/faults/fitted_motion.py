"""A log's motion with the fitted forces and their slopes, from which faults' `columns` are made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.equations.machine import number_places, numbers
from pteron.identification.model import Model
from pteron.identification.signals import States
from pteron.kernels import Array, Kernel
from pteron.kernels.targets import compile
from pteron.manipulator import Manipulator, parameters

_STEP = 1e-6
"""Step of difference quotients of forces: m, rad, or a share of a joint's range."""

_FEWEST = 8
"""Least number of states at which columns that take long are computed."""


def lengths_of(robot: Manipulator) -> list[tuple[int, int]]:
    """Return (leg from 0, index into `numbers`) of each geometric number that is a length, m."""
    places = []
    for i, (leg, at) in enumerate(zip(robot.legs, number_places(robot), strict=False)):
        sizes = {q.name: len(q.value) for q in leg.quantities if q.role in ("point", "length")}
        for name, size in (sizes | {"platform_point": 3}).items():
            places += [(i, at[name] + k) for k in range(size)]
    return places


@dataclass(frozen=True)
class FittedMotion:
    """States of a motion, and the forces of a fit at them.

    Parameters
    ----------
    model : Model
        The model.
    values : array, shape (p,)
        Its values, by the fit.
    states : States
        R states.
    usual : array, shape (n,)
        Root mean square rate of each joint in the log.
    along : array, shape (R,)
        The time, from -0.5 at the log's beginning to 0.5 at its end.
    stride : int
        Changes with the machine, which are smooth and costly, are worked out at every so many
        states, and interpolated.
    cutoff : float, optional
        Cut-off of loads that are to be differentiated, Hz.
    """

    model: Model
    values: Array
    states: States
    usual: Array
    along: Array
    stride: int = 1
    cutoff: float | None = None

    @cached_property
    def matrix(self) -> Array:
        """The model's own columns (R, n, p)."""
        return self.model.matrix(self.states)

    def forces(self, *, of: Sequence[str] | None = None, without: Sequence[str] = ()) -> Array:
        """Return the fit's forces (R, n): of all terms, `of` some kinds, or `without` some."""
        chosen = [(of is None or kind in of) and kind not in without for kind in self.model.kinds]
        return np.asarray(self.matrix @ np.where(chosen, self.values, 0.0))

    @property
    def direction(self) -> Array:
        """The sign of each joint's rate (R, n)."""
        return np.sign(self.states.joint_rates)

    def rate(self, signal: Array) -> Array:
        """Return the derivative by time of signals (R, n)."""
        return np.asarray(np.gradient(signal, self.states.time, axis=0, edge_order=2))

    # How the rigid bodies' forces change with the machine

    @cached_property
    def length_slopes(self) -> Array:
        """Slopes (R, n, k) of forces by each of `lengths_of`, the joints being measured."""
        unit = np.eye(len(self._geometry))
        return self._slopes_along(unit[[place for _, place in lengths_of(self.model.robot)]])

    @cached_property
    def zero_slopes(self) -> Array:
        """Slopes (R, n, n) of forces by the zero of each joint."""
        zero = np.zeros_like(self.states.joints)
        return self.lag_slopes([zero + 1.0, zero, zero])

    @cached_property
    def ratio_slopes(self) -> Array:
        """Slopes (R, n, n) of forces as each joint moves less than was measured, as a share."""
        s = self.states
        middle = s.joints.mean(axis=0)
        return self.lag_slopes([s.joints - middle, s.joint_rates, s.joint_accelerations])

    def tilt_slopes(self) -> Array:
        """Return slopes (R, n, 2) of forces as gravity tilts about two axes."""
        g = np.array(self.model.robot.gravity)
        size = float(np.linalg.norm(g))
        changes = np.zeros((2, len(self._geometry)))
        if size > 0.0:
            changes[:, -3:] = size * np.linalg.svd(g[None, :])[2][1:]
        return self._slopes_along(changes)

    def lag_slopes(self, motion: Sequence[Array]) -> Array:
        """Return slopes (R, n, n) of forces with respect to a lag of each joint.

        Joints are behind by a `motion`: its coordinates, rates and accelerations, (R, n) each.
        """
        behind = [change[self._sampled_rows] for change in motion]
        columns = []
        for i, size in enumerate(_STEP * np.ptp(self._rigid[0].joints, axis=0)):
            part = np.zeros(behind[0].shape[1])
            part[i] = -size / max(float(np.abs(behind[0][:, i]).max()), np.finfo(float).tiny)
            changed = self._forces_at(self._geometry, *(part * change for change in behind))
            columns.append((changed - self._reference_forces) / -part[i])
        return self._interpolate_rows(np.stack(columns, axis=-1))

    def _slopes_along(self, changes: Array) -> Array:
        """Return slopes (R, n, k) of forces along changes (k, g) of the geometry's numbers."""
        columns = [
            (self._forces_at(self._geometry + _STEP * change) - self._reference_forces) / _STEP
            for change in changes
        ]
        return self._interpolate_rows(np.stack(columns, axis=-1))

    def _interpolate_rows(self, columns: Array) -> Array:
        """Return columns at all rows (R, ...), by splines between the sampled rows."""
        rows = len(self.states)
        if len(self._sampled_rows) == rows:
            return columns
        return np.asarray(
            scipy.interpolate.make_interp_spline(self._sampled_rows, columns, k=5)(np.arange(rows))
        )

    @cached_property
    def _sampled_rows(self) -> NDArray[np.int64]:
        """Rows of every `stride`-th state, the first and the last among them."""
        rows = len(self.states)
        count = max(rows // self.stride, min(rows, _FEWEST))
        return np.unique(np.linspace(0, rows - 1, count).astype(int))

    @cached_property
    def _geometry(self) -> Array:
        """The numbers (g,) of the machine's geometry, as in its file."""
        return np.array(numbers(self.model.robot))

    @cached_property
    def _rigid(self) -> tuple[States, Array]:
        """The sampled states, and drawn parameters (N,) adjusted to the fitted base values."""
        base, drawn = self.model.base, parameters(self.model.robot)
        change = self.values[: base.rank] - base.grouping @ drawn
        return self.states.part(self._sampled_rows), drawn + base.selection @ change

    @cached_property
    def _kernels(self) -> tuple[Kernel, ...]:
        """The compiled kernels of a Newton step, the platform's motion and inverse dynamics."""
        outputs = "newton_step", "platform_motion", "inverse_dynamics"
        return tuple(compile(self.model.robot, what, "vm", grade="general") for what in outputs)

    @cached_property
    def _reference_forces(self) -> Array:
        """The forces at the sampled rows, with the geometry of the machine's file."""
        return self._forces_at(self._geometry)

    def _forces_at(self, geometry: Array, *added: Array) -> Array:
        """Return the forces with another geometry, and with a motion added to the joints'.

        Another geometry puts the platform elsewhere, as the joints are what was measured.
        """
        s, inertia = self._rigid
        q, dq, ddq = added or (0.0, 0.0, 0.0)
        newton_step, platform_motion, inverse_dynamics = self._kernels
        # One step of Newton's: its error is of second order in a change that is small.
        pose, _ = newton_step(s.joints + q, s.pose, geometry=geometry)
        moves = platform_motion(
            pose, s.joint_rates + dq, s.joint_accelerations + ddq, geometry=geometry
        )
        return np.asarray(inverse_dynamics(pose, *moves, geometry=geometry, parameters=inertia))
