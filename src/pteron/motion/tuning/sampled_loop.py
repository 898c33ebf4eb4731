"""The linear loop of machine, encoders and controller from sample to sample, its delay exact."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from pteron.kernels import Array
from pteron.motion.simulation.loop import split_delay
from pteron.motion.tuning.linear_law import LinearLaw
from pteron.motion.tuning.linear_plant import LinearPlant
from pteron.renamed import former_attribute


@dataclass(frozen=True)
class SampledLoop:
    """A machine under a controller, linearised, from a sample to the next.

    Forces are held for a period and act a delay after their sample, of any length; both are exact.
    Encoders' steps do not count, but the lag of rates by differences and of their filter does.

    Attributes
    ----------
    plant : LinearPlant
        The machine.
    law : LinearLaw
        The controller.
    period : float
        s.
    delay : float
        From a sample to the drives' force, s.
    share : float or array, shape (n,), optional
        What a sample's difference counts in a rate, by the filter's cut-off, 1 without a filter;
        NaN where a rate is exact, as all are by default.
    """

    plant: LinearPlant
    law: LinearLaw
    period: float
    delay: float = 0.0
    share: float | Array | None = None

    def open_loop(self, more: float = 0.0) -> tuple[Array, Array, Array]:
        """Return the matrices (F, G, H) of the discrete-time loop, opened at all drives.

        With the state x_k at sample k, the forces u_k that the drives apply, and the forces y_k
        that the controller commands: x_(k+1) = F x_k + G u_k, y_k = H x_k. The state has the
        deviations of the plant's state, the last readings of joints and rates, the controller's
        memory and the commanded forces still delayed. `more` is a further delay in seconds.
        """
        period, law, n = self.period, self.law, self.plant.inputs.shape[1]
        late, delay_samples = split_delay(self.delay + more, period)
        late_transition, late_inputs = self.plant.zero_order_hold(period - late)
        early_transition, early_inputs = self.plant.zero_order_hold(late)
        transition, early_inputs = (
            late_transition @ early_transition,
            late_transition @ early_inputs,
        )
        shares = np.broadcast_to(np.nan if self.share is None else self.share, n)
        is_differenced = np.isfinite(shares)
        has_differences = bool(is_differenced.any())
        sizes = [
            len(transition),
            2 * n * has_differences,
            len(law.matrix),
            *[n] * (delay_samples + 1),
        ]
        places = np.split(np.arange(sum(sizes)), np.cumsum(sizes)[:-1])
        state, last, memory, *waiting = places
        size = sum(sizes)
        # What the controller is told, of the whole state.
        measured = np.zeros((2 * n, size))
        measured[:, state] = self.plant.outputs
        if has_differences:
            share = np.diag(np.where(is_differenced, shares, 1.0))
            measured[n:][is_differenced] = 0.0
            differences = np.zeros((n, size))
            differences[:, state] = share @ self.plant.differenced / period
            differences[:, last] = np.hstack([-share / period, np.eye(n) - share])
            measured[n:][is_differenced] = differences[is_differenced]
        force_rows = law.feedthrough @ measured
        force_rows[:, memory] += law.outputs
        matrix, inputs = np.zeros((size, size)), np.zeros((size, n))
        matrix[np.ix_(state, state)] = transition
        if has_differences:
            matrix[np.ix_(last[:n], state)] = self.plant.differenced
            matrix[last[n:]] = measured[n:]
        matrix[memory] = law.inputs @ measured
        matrix[np.ix_(memory, memory)] += law.matrix
        # waiting[k] was asked for k + 1 samples ago.
        matrix[np.ix_(state, waiting[delay_samples])] = early_inputs
        if delay_samples:
            matrix[np.ix_(state, waiting[delay_samples - 1])] = late_inputs
        else:
            inputs[state] = late_inputs
        for newer, older in pairwise(waiting):
            matrix[np.ix_(older, newer)] = np.eye(n)
        inputs[waiting[0]] = np.eye(n)
        return matrix, inputs, force_rows

    def closed_loop(self, more: float = 0.0) -> Array:
        """Return the matrix (S, S) of the closed loop per sample, with `more` s of extra delay."""
        matrix, inputs, force_rows = self.open_loop(more)
        return matrix + inputs @ force_rows

    @cached_property
    def poles(self) -> Array:
        """Poles of the closed loop in the plane of z = exp(s period)."""
        return np.asarray(np.linalg.eigvals(self.closed_loop()))

    def response(self, frequencies: Array) -> Array:
        """Return the loop's frequency response L (W, n, n), from drive forces to commanded forces.

        The loop is opened at all drives; I + L is singular where the closed loop has a pole.
        Frequencies are in rad/s, at most pi / period.
        """
        matrix, inputs, force_rows = self.open_loop()
        z = np.exp(1j * frequencies * self.period)[:, None, None]
        return -force_rows @ np.linalg.solve(z * np.eye(len(matrix)) - matrix, inputs + 0j * z)

    opened = former_attribute("opened", "open_loop")
    closed = former_attribute("closed", "closed_loop")
