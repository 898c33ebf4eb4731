"""The paper's claim that its reduced model is about 41 % faster, tried in each form of the model.

Prints the model's forms, complete and reduced, side by side: operations counted, times measured in
one run with the rounds taking turns, the quickest of each. A percentage is that of the two numbers
before it. Times are of this machine; ratios carry.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import casadi
import numpy as np
from measuring import Array, Contestant, States, contest, quick, random_states, relative_error

import pteron
from pteron.reduction import FORMS, BaseParameters, model_forms
from pteron.report.costs import costs, fewer

_STATES = 1024
_WHICH = ("complete", "reduced")

Terms = tuple[Array, Array, Array, Array, Array]
"""J (b, m, m), Omega_p (b, n, n), link Jacobians (b, 2n, 6, m), link Omegas (b, 2n, 6, 4) and the
platform's Omega (b, m, 4), from the kernel `paper_terms`."""


def main() -> None:
    """Print the table for every machine of the catalog with the legs of the paper."""
    print(
        f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, "
        f"NumPy {np.__version__}, CasADi {casadi.__version__}, Pteron {pteron.__version__}"
    )
    robots = {name: pteron.load(name) for name in pteron.catalog()}
    legs = {name: {type(leg) for leg in robot.legs} for name, robot in robots.items()}
    names = [name for name in robots if legs[name] == {pteron.legs.Leg}]
    for name in names[: 1 if quick() else None]:
        base = pteron.base_parameters(robots[name])
        runners = contestants(base, random_states(base.robot, _STATES))
        assert all(runner.error < 1e-9 for runner in runners), "all forms give the same forces"
        times = contest(runners, 3 if quick() else 15)
        counted = costs(base)
        print(f"\n{name:<50}{'operations':>12}{'reduced':>9}{'':>14}{'us':>8}{'reduced':>9}")
        for i, form in enumerate(("dense", *FORMS)):
            complete, reduced = counted[2 * i : 2 * i + 2]
            seconds = [float(times[f"{form}, {which}"].min()) for which in _WHICH]
            # As printed: whoever divides the two numbers finds the percentage.
            us = [round(1e6 * one, 3) for one in seconds]
            print(
                f"{complete.form:<50}{complete.operations:>12}{reduced.operations:>9}"
                f"{fewer(reduced.operations, complete.operations):>14}"
                f"{us[0]:>8.3f}{us[1]:>9.3f}  {fewer(us[1], us[0], 'less')}"
            )


def contestants(base: BaseParameters, state: States) -> list[Contestant]:
    """Return every form, complete and reduced, of a machine's model."""
    expected = pteron.inverse_dynamics(base.robot, *state)
    terms: Terms = pteron.compile(base.robot, "paper_terms")(*state)
    every = range(base.selection.shape[0])
    runs: dict[str, Callable[[], Array]] = {}
    for which, kept, values in (
        ("complete", every, pteron.parameters(base.robot)),
        ("reduced", base.kept, base.values()),
    ):
        dense = Dense.of(terms, kept, values)
        runs[f"dense, {which}"] = dense.forces
    for (form, which), kernel in model_forms(base).items():
        runs[f"{form}, {which}"] = partial(kernel, *state)

    def timed(run: Callable[[], Array]) -> Callable[[], float]:
        def seconds() -> float:
            start = time.perf_counter()
            run()
            return (time.perf_counter() - start) / _STATES

        return seconds

    return [
        Contestant(name, timed(run), relative_error(run(), expected)) for name, run in runs.items()
    ]


@dataclass(frozen=True)
class Dense:
    """Eq. (15) as a reader of the paper would evaluate it: one dense product after another.

    Parameters
    ----------
    jacobian : array, shape (b, m, m)
    blocks : list of (array, array)
        The Jacobian (b, r, m) and the columns of Omega (b, r, k) that are kept, of the sliders and
        of each link; the platform's Omega has no Jacobian.
    platform : array, shape (b, m, k)
    values : array
        One for each kept column.
    """

    jacobian: Array
    blocks: list[tuple[Array, Array]]
    platform: Array
    values: Array

    @classmethod
    def of(cls, terms: Terms, kept: Sequence[int], values: Array) -> Dense:
        """Return the model for the columns that are kept."""
        jacobian, sliders, jacobians, links, platform = terms
        n, count = sliders.shape[-1], jacobians.shape[1]

        def chosen(start: int, omega: Array) -> Array:
            own = [k - start for k in kept if start <= k < start + omega.shape[-1]]
            return np.ascontiguousarray(omega[..., own])

        blocks = [(jacobian, chosen(0, sliders))]
        for i in range(count):
            blocks.append((np.ascontiguousarray(jacobians[:, i]), chosen(n + 4 * i, links[:, i])))
        return cls(jacobian, blocks, chosen(n + 4 * count, platform), values)

    def forces(self) -> Array:
        """Return F_a = -J^-T [ J^T Om_p  J_u^T Om_u  J_l^T Om_l  Om_e ] P, shape (b, n)."""
        products = [np.swapaxes(j, -1, -2) @ omega for j, omega in self.blocks]
        bracket = np.concatenate([*products, self.platform], axis=-1)
        transposed = np.swapaxes(self.jacobian, -1, -2)
        return np.asarray(-(np.linalg.solve(transposed, bracket) @ self.values))


if __name__ == "__main__":
    main()
