"""The nearest pose at which a function vanishes, and a distance that is proved free of such poses.

Branch and bound: boxes of poses about the one asked for are cut in two, the nearest first. Those in
which intervals prove that the function does not vanish, or no pose is in reach, are done with; so
are those that are farther than a singular pose that is known. The nearest box that is left bounds
the distance from below. From the middles of others Newton's steps, in pose and roots, lead to
singular poses, which need no change of sign and may lie on the edge of reach; and from the best of
them sequential quadratic programming leads to the nearest.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import scipy  # type: ignore[import-untyped]
from numpy.typing import NDArray

from pteron.kernels import Array
from pteron.tolerances import EXACT
from pteron.workspace.boxes import halve_boxes, vary_coordinates
from pteron.workspace.vanishing import Vanishing

SINGULAR = 1e-10
"""Largest measure of a pose that counts as singular."""

_BATCH = 256
"""Boxes examined in a round, the nearest."""

_TRIED = 12
"""Boxes of a round from which a singular pose is sought."""

_SEEKING, _SELDOM = 16, 4
"""In each of the first 16 rounds a singular pose is sought, afterwards in every fourth."""

_FARTHER = 1.2
"""Factor on the least distance known, within which another singular pose is worth quadratic
programs."""

_BESIDE = 0.1
"""Share of a pose's distance within which other poses count as its neighbours and are left out."""

_LAST, _HITS = 256, 12
"""Boxes searched of those left in the end, the nearest and as many spread over all; and poses found
in them that lead to quadratic programs."""

_STEPS = 30
"""Newton's steps, so many since they only halve the distance where a function does not change its
sign."""

_BACK = 10
"""Newton's steps back into reach."""

_CONVERGED = 1e-14
"""Greatest residual at which Newton's steps end."""

_RETRACTIONS, _GAIN = 16, 1e-6
"""Most rounds in which a state is brought nearer, and the least gain, over the distance."""

_RESTARTS = 4
"""Quadratic programs, each from the result of the last one."""

_CLOSE = 5e-3
"""Share of the distance to which it is searched."""

_EDGE = 1e-9
"""Roots, and squares of type-I measures, below zero that count as in reach, as a share of the
largest: of a pose on the edge."""


class Nearest(NamedTuple):
    """The nearest pose found at which a function vanishes, if any, and a proved lower bound."""

    pose: Array | None
    measure: float
    bound: float
    """No such pose is nearer: proved. Infinite where there is none at all."""


class Search:
    """A search about a pose, in some of its coordinates.

    Coordinates `moving` (k,) of the pose vary, metres or angles, within a box (2, k). `report` is
    called with the share of the work that is done, after each batch of boxes.
    """

    def __init__(
        self,
        vanishing: Vanishing,
        at: Array,
        moving: NDArray[np.intp],
        box: Array,
        report: Callable[[float], None],
    ) -> None:
        self._report = report
        self.vanishing, self.reference, self.moving, self.box = vanishing, at, moving, box
        self.smooth = vanishing.smooth
        others = np.ones(len(at), bool)
        if vanishing.leg:
            others[vanishing.leg - 1] = False
        self.others = np.flatnonzero(others)

    def run(self, horizon: float, most: int) -> Nearest:
        """Return the nearest pose at which the function vanishes, within the distance `horizon`."""
        boxes, distances = self.box[None], self._distances(self.box[None])
        best, nearest, examined, rounds = None, horizon, 0, 0
        while len(boxes) and examined < most and distances.min() < (1.0 - _CLOSE) * nearest:
            order = np.argsort(distances, kind="stable")
            batch, others = boxes[order[:_BATCH]], boxes[order[_BATCH:]]
            examined += len(batch)
            batch = batch[~self.vanishing.proves_absence(self._pose_boxes(batch))]
            sources = batch[: 0 if rounds >= _SEEKING and rounds % _SELDOM else _TRIED]
            rounds += 1
            best, nearest = self._improve_nearest(sources, best, nearest, 1)
            boxes = np.concatenate([halve_boxes(batch), others])
            distances = self._distances(boxes)
            boxes, distances = boxes[distances < nearest], distances[distances < nearest]
            proved = (
                float(distances.min(initial=nearest)) / nearest if 0.0 < nearest < np.inf else 0.0
            )
            self._report(min(max(examined / most, proved / (1.0 - _CLOSE)), 1.0))
        if len(boxes) and distances.min() < (1.0 - _CLOSE) * nearest:
            order = np.argsort(distances, kind="stable")
            last = np.concatenate([order[:_LAST], order[:: max(1, len(order) // _LAST)]])
            best, nearest = self._improve_nearest(boxes[last], best, nearest, _HITS)
            if best is not None and len(self.moving) > 1:
                best = self._retract(best)
                nearest = self._length(best)
        bound = float(distances.min(initial=nearest)) * (1.0 - EXACT)
        if best is None:
            return Nearest(None, np.nan, bound)
        return Nearest(self._pose(best), float(self._values(best[None])[0][0, 0]), bound)

    def _improve_nearest(
        self, boxes: Array, best: Array | None, nearest: float, most: int
    ) -> tuple[Array | None, float]:
        """Return the nearest singular state and its distance, updated from boxes (B, 2, k).

        From the nearest of them, `most` at most and none next to another, quadratic programs go on.
        """
        hits = self._singular_states(boxes.mean(axis=1))
        for _ in range(most):
            places = hits[:, : len(self.moving)]
            lengths = np.linalg.norm(places, axis=-1)
            if self._sizes[0] * float(lengths.min(initial=np.inf)) >= _FARTHER * nearest:
                break
            k = int(lengths.argmin())
            improved = self._descend(hits[k])
            if self._length(improved) < nearest:
                best, nearest = improved, self._length(improved)
            hits = hits[np.linalg.norm(places - places[k], axis=-1) > _BESIDE * lengths[k]]
        return best, nearest

    # A state is a pose's coordinates that vary, and the roots, as shares of their sizes.

    @cached_property
    def _sizes(self) -> tuple[float, Array]:
        """The units of lengths and roots: their sizes in the box."""
        length = float(np.linalg.norm(self.box[1] - self.box[0]))
        if not self.smooth.roots:
            return length, np.empty(0)
        pose_boxes = self._pose_boxes(self.box[None])
        low, high, _ = self.smooth.radicands(
            pose_boxes[:, 0], pose_boxes[:, 1], range(self.smooth.roots)
        )
        most = np.nan_to_num(np.abs(np.concatenate([low, high])).max(axis=0), posinf=1.0)
        return length, np.sqrt(np.where(most > 0.0, most, 1.0))

    def _pose(self, state: Array) -> Array:
        """Return poses (..., m) of states (..., k + R)."""
        ways = self._sizes[0] * state[..., : len(self.moving)]
        return vary_coordinates(self.reference, self.reference[self.moving] + ways, self.moving)

    def _length(self, state: Array) -> float:
        """Return the distance, m or rad, of a state's pose from the reference pose."""
        return self._sizes[0] * float(np.linalg.norm(state[: len(self.moving)]))

    def _values(self, states: Array) -> tuple[Array, Array, Array]:
        """Return equality residuals, inequality residuals and both Jacobians at states (K, k + R).

        The residuals are the function's value and r^2 - g, (K, 1 + R); r and the squares of the
        other legs' measures, (K, R + n) or one less; the Jacobians are (K, 1 + 2 R + n, k + R).
        """
        k, (length, sizes) = len(self.moving), self._sizes
        count, r = len(states), len(sizes)
        roots = states[:, k:] * sizes
        outputs, slopes = (
            np.asarray(part) for part in self.smooth.function(self._pose(states).T, roots.T)
        )
        slopes = slopes.reshape(len(outputs), count, len(self.reference) + r).swapaxes(0, 1)
        columns = [*self.moving, *range(len(self.reference), len(self.reference) + r)]
        slopes = slopes[:, :, columns] * np.concatenate([np.full(k, length), sizes])
        outputs = outputs.T
        radicand_errors = (roots * roots - outputs[:, 1 : 1 + r]) / sizes**2
        slopes[:, 1 : 1 + r] /= -(sizes**2)[:, None]
        slopes[:, np.arange(r) + 1, np.arange(r) + k] += 2.0 * states[:, k:]
        squares, square_slopes = outputs[:, 1 + r :], slopes[:, 1 + r :]
        root_slopes = np.zeros((count, r, k + r))
        root_slopes[:, np.arange(r), np.arange(r) + k] = 1.0
        return (
            np.hstack([outputs[:, :1], radicand_errors]),
            np.hstack([states[:, k:], squares[:, self.others]]),
            np.concatenate(
                [slopes[:, : 1 + r], root_slopes, square_slopes[:, self.others]], axis=1
            ),
        )

    def _singular_states(self, places: Array) -> Array:
        """Return singular states to which Newton's minimum-norm steps lead from places (K, k).

        Those that lead out of reach go on to where it ends: a sheet of singular poses may be in
        reach in a corner only.
        """
        k, (length, sizes) = len(self.moving), self._sizes
        states = np.zeros((len(places), k + len(sizes)))
        states[:, :k] = (places - self.reference[self.moving]) / length
        if not len(states):
            return states
        roots = np.zeros((len(sizes), len(states)))
        radicands = np.asarray(self.smooth.function(self._pose(states).T, roots)[0])[
            1 : 1 + len(sizes)
        ]
        states[:, k:] = np.sqrt(np.maximum(radicands.T, 0.0)) / sizes
        states = self._solve_by_newton(states, _STEPS, into_reach=False)
        singular = self._is_singular(states)
        if singular.all():
            return states
        returned = self._solve_by_newton(states[~singular], _BACK, into_reach=True)
        return np.concatenate([states[singular], returned[self._is_singular(returned)]])

    def _solve_by_newton(self, states: Array, steps: int, *, into_reach: bool) -> Array:
        """Return the states to which Newton's method leads from states (K, k + R).

        With `into_reach` the quantities that must not be negative count too.
        """
        with np.errstate(all="ignore"):
            for _ in range(steps):
                residuals, nonnegative, slopes = self._values(states)
                count = residuals.shape[1]
                if into_reach:
                    residuals = np.hstack([residuals, np.minimum(nonnegative, 0.0)])
                    slopes[:, count:][nonnegative >= 0.0] = 0.0
                    count = residuals.shape[1]
                slopes = slopes[:, :count]
                finite = np.isfinite(residuals).all(axis=-1) & np.isfinite(slopes).all(
                    axis=(-2, -1)
                )
                states, residuals, slopes = states[finite], residuals[finite], slopes[finite]
                if (np.abs(residuals) <= _CONVERGED).all():
                    break
                inverse_slopes = np.linalg.pinv(slopes, rcond=1e-12)
                states = states - (inverse_slopes @ residuals[..., None])[..., 0]
        return states

    def _is_singular(self, states: Array) -> NDArray[np.bool_]:
        """Return which states (K,) are singular poses in reach."""
        if not len(states):
            return np.zeros(0, bool)
        residuals, nonnegative, _ = self._values(states)
        vanishes = (np.abs(residuals) <= SINGULAR).all(axis=-1)
        return np.asarray(vanishes & (nonnegative >= -_EDGE).all(axis=-1))

    def _descend(self, state: Array) -> Array:
        """Return the nearest singular state, by sequential quadratic programming from a state."""
        if len(self.moving) == 1 or self._length(state) == 0.0:
            return state
        with np.errstate(all="ignore"):
            for _ in range(_RESTARTS):
                candidate = self._solve_programs(state)
                if not (np.isfinite(candidate).all() and self._is_singular(candidate[None])[0]):
                    return self._retract(state)
                last, state = state, min(state, candidate, key=self._length)
                if self._length(state) > (1.0 - _EDGE) * self._length(last):
                    break
        return state

    def _solve_programs(self, state: Array) -> Array:
        """Return the solution of sequential quadratic programming from a state."""
        # Kinematics load without SciPy.
        k, count = len(self.moving), 1 + len(self._sizes[1])
        scale = float(state[:k] @ state[:k])

        def distance(x: Array) -> tuple[float, Array]:
            """Return half the scaled squared distance to the pose and its gradient at x."""
            way = np.concatenate([x[:k], np.zeros(len(x) - k)])
            return 0.5 * float(way @ way) / scale, way / scale

        @lru_cache(maxsize=1)
        def residuals(x: bytes) -> list[Array]:
            """Return equality and inequality residuals, and slopes, at a state in bytes."""
            return [part[0] for part in self._values(np.frombuffer(x)[None])]

        def part(i: int, rows: slice) -> dict[str, object]:
            """Return a SciPy constraint: residuals i, equality for 0, with `rows` of slopes."""
            return {
                "type": ("eq", "ineq")[i],
                "fun": lambda x: residuals(x.tobytes())[i],
                "jac": lambda x: residuals(x.tobytes())[2][rows],
            }

        run = scipy.optimize.minimize(
            distance,
            state,
            jac=True,
            method="SLSQP",
            constraints=[part(0, slice(count)), part(1, slice(count, None))],
            options={"ftol": 1e-14, "maxiter": 60},
        )
        return np.asarray(run.x)

    def _retract(self, state: Array) -> Array:
        """Return a nearer singular state, by Newton's method from places nearer than a state.

        Where the function touches zero it has no slope that quadratic programs could use.
        """
        k = len(self.moving)
        rng, shares = np.random.default_rng(0), 0.5 ** np.arange(1, _RETRACTIONS + 1)
        for _ in range(_RETRACTIONS):
            offsets = (
                rng.normal(size=(3, _RETRACTIONS, k)) * np.array([0.0, 0.5, 1.0])[:, None, None]
            )
            size = float(np.linalg.norm(state[:k]))
            places = state[:k] * (1.0 - shares[:, None]) + offsets * (size * shares[:, None])
            places = self.reference[self.moving] + self._sizes[0] * places.reshape(-1, k)
            states = self._singular_states(places)
            nearest = min(states, key=self._length, default=state)
            if self._length(nearest) > (1.0 - _GAIN) * self._length(state):
                break
            state = nearest
        return state

    def _pose_boxes(self, boxes: Array) -> Array:
        """Return boxes (B, 2, m) of poses."""
        return vary_coordinates(self.reference, boxes, self.moving)

    def _distances(self, boxes: Array) -> Array:
        """Return the distances (B,) of boxes (B, 2, k) from the reference pose."""
        here = self.reference[self.moving]
        gaps = np.maximum(np.maximum(boxes[:, 0] - here, here - boxes[:, 1]), 0.0)
        return np.asarray(np.linalg.norm(gaps, axis=-1))
