"""The paper's two statements on its reduced model, in every reading that its text allows.

"Faster by 41 %" (section 5) means 29 % less time, "41 % less time" (conclusion) is more. The
original is Eq. (13), body by body, or Eq. (15), the regressor with all columns; the reduced model
is Eq. (15) with the kept columns. They are evaluated with full matrices, with sparse ones, or as
one graph in which common subexpressions are shared. Operations are counted; times are of one run in
which the contestants take turns, the quickest of each. Ratios carry to other computers better than
times do.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import casadi as ca
import numpy as np
from measuring import Array, Contestant, States, contest, quick, random_states, relative_error

import pteron
from pteron.equations import regressor
from pteron.equations.machine import Machine
from pteron.kernels import TARGETS, Kernel, Port
from pteron.reduction import BaseParameters, model_forms
from pteron.report.costs import dense_operations, saving_text

_STATES = 1024
ORIGINALS = ("Eq. (13)", "Eq. (15)")
REDUCED = "reduced"

Factors = tuple[Array, Array, Array, Array, Array]
"""J (b, m, m), Omega_p (b, n, n), link Jacobians (b, 2n, 6, m), link Omegas (b, 2n, 6, 4) and the
platform's Omega (b, m, 4), from the kernel `paper_terms`."""


def main() -> None:
    """Print the readings for every machine of the catalog with the legs of the paper."""
    print(
        f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, "
        f"NumPy {np.__version__}, CasADi {ca.__version__}, Pteron {pteron.__version__}"
    )
    robots = {name: pteron.load(name) for name in pteron.catalog()}
    legs = {name: {type(leg) for leg in robot.legs} for name, robot in robots.items()}
    names = [name for name in robots if legs[name] == {pteron.legs.Leg}]
    for name in names[: 1 if quick() else None]:
        print_readings(name, pteron.base_parameters(robots[name]))


def print_readings(name: str, base: BaseParameters) -> None:
    """Print, of each way to evaluate, both originals and what the reduced model saves of them."""
    evaluations = readings(base, random_states(base.robot, _STATES))
    runs = [run for ways in evaluations.values() for run in ways.values()]
    assert all(run.error < 1e-9 for run in runs), "all forms give the same forces"
    times = contest([run.contestant for run in runs], 3 if quick() else 15)
    print(f"\n{name}: {base.selection.shape[0]} parameters, {base.rank} base parameters")
    print(f"{'evaluated':<22}{'model':<10}{'operations':>11}{'us':>8}   reduced against it")
    for evaluation, ways in evaluations.items():
        us = {key: round(1e6 * float(times[run.name].min()), 3) for key, run in ways.items()}
        less = ways[REDUCED].operations
        for key, run in ways.items():
            verdict = ""
            if key != REDUCED:
                verdict = (
                    f"{saving_text(less, run.operations)} operations, "
                    f"{saving_text(us[REDUCED], us[key], 'less')} time "
                    f"({100.0 * (us[key] / us[REDUCED] - 1.0):+.0f} % faster)"
                )
            print(f"{evaluation:<22}{key:<10}{run.operations:>11}{us[key]:>8.3f}   {verdict}")


@dataclass(frozen=True)
class Run:
    """One model, evaluated in one way: its name, operations of a state, and what is timed."""

    name: str
    operations: int
    call: Callable[[], Array]
    error: float

    @property
    def contestant(self) -> Contestant:
        """What `contest` times."""

        def seconds() -> float:
            start = time.perf_counter()
            self.call()
            return (time.perf_counter() - start) / _STATES

        return Contestant(self.name, seconds, self.error)


def readings(base: BaseParameters, state: States) -> dict[str, dict[str, Run]]:
    """Return the runs of each way to evaluate, by original and `REDUCED`."""
    expected = pteron.inverse_dynamics(base.robot, *state)
    factors: Factors = pteron.compile(base.robot, "paper_terms")(*state)
    every = range(base.selection.shape[0])
    dense = {
        "Eq. (13)": Dense.of(factors, every, pteron.parameters(base.robot)),
        "Eq. (15)": Dense.of(factors, every, pteron.parameters(base.robot)),
        REDUCED: Dense.of(factors, base.kept, base.values()),
    }
    counts = {
        "Eq. (13)": dense_virtual_work_operations(base),
        "Eq. (15)": dense_operations(base, every),
        REDUCED: dense_operations(base, base.kept),
    }
    calls = {key: model.by_regressor for key, model in dense.items()}
    calls["Eq. (13)"] = dense["Eq. (13)"].body_by_body
    found = {"full matrices": {key: (counts[key], calls[key]) for key in calls}}

    sparse = sparse_kernels(base)
    found["sparse matrices"] = {
        key: (kernel.operations, partial(kernel, *factors)) for key, kernel in sparse.items()
    }
    graphs = model_forms(base)
    for name, form in (
        ("graph, J^-T [...] P", "regressor"),
        ("graph, J^-T last", "regressor, J^-T last"),
    ):
        kernels = {
            "Eq. (13)": graphs["virtual work", "complete"],
            "Eq. (15)": graphs[form, "complete"],
            REDUCED: graphs[form, "reduced"],
        }
        found[name] = {
            key: (kernel.operations, partial(kernel, *state)) for key, kernel in kernels.items()
        }
    return {
        evaluation: {
            key: Run(f"{evaluation}, {key}", count, call, relative_error(call(), expected))
            for key, (count, call) in ways.items()
        }
        for evaluation, ways in found.items()
    }


def dense_virtual_work_operations(base: BaseParameters) -> int:
    """Return the operations of Eq. (13), every matrix taken as full.

    Per link F_b = Omega_b p_b, 6 rows of k products, J_b^T F_b, and its sum; the platform's; the
    sliders' forces; one elimination. Counted as in `dense_operations`.
    """
    robot = base.robot
    m, n = robot.freedom, len(robot.legs)
    links = [body for leg in robot.legs for body in leg.bodies.values() if len(body.kinds) > 1]
    sliders = sum(body.kinds == ("m",) for leg in robot.legs for body in leg.bodies.values())
    wrenches = sum(6 * (2 * len(body.kinds) - 1) + m * (2 * 6 - 1) + m for body in links)
    carried = len([p for p in base.parameters if not p.legs])
    platform_force = m * (2 * carried - 1)
    elimination = round(2.0 * m * m * m / 3.0) + 2 * m * m
    return wrenches + platform_force + elimination + sliders + n


def sparse_kernels(base: BaseParameters) -> dict[str, Kernel]:
    """Return kernels of the products alone, given the factors, with structural zeros dropped."""
    robot = base.robot
    machine, m, n = Machine.numeric(robot), robot.freedom, len(robot.legs)
    symbols = [ca.SX.sym("", m) for _ in range(3)]
    parts = regressor.terms(machine, machine.state(*symbols))
    count = len(parts.links)
    ports = (
        Port("jacobian", (m, m)),
        Port("sliders", (n, n)),
        Port("link_jacobians", (count, 6, m)),
        Port("links", (count, 6, 4)),
        Port("platform", parts.platform.shape),
    )
    flat = [ca.SX.sym(port.name, port.size) for port in ports]

    def patterned(values: ca.SX, like: ca.SX) -> ca.SX:
        """Return a matrix of given entries, in rows, with the zeros of another."""
        rows, columns = like.shape
        return ca.project(ca.reshape(values, columns, rows).T, like.sparsity())

    jacobian = patterned(flat[0], parts.jacobian)
    factors = regressor.RegressorTerms(
        jacobian,
        patterned(flat[1], parts.sliders),
        parts.with_slider,
        tuple(
            patterned(flat[2][6 * m * k : 6 * m * (k + 1)], part)
            for k, part in enumerate(parts.link_jacobians)
        ),
        tuple(
            patterned(flat[3][24 * k : 24 * (k + 1)], part) for k, part in enumerate(parts.links)
        ),
        patterned(flat[4], parts.platform),
    )
    inverse = ca.cse(-ca.inv_minor(jacobian).T)
    complete, selection = ca.SX.eye(len(base.parameters)), ca.sparsify(ca.SX(ca.DM(base.selection)))
    values = {"complete": pteron.parameters(robot), "reduced": base.values()}
    kernels = {}
    for key, columns, which in (
        ("Eq. (13)", complete, "complete"),
        ("Eq. (15)", complete, "complete"),
        (REDUCED, selection, "reduced"),
    ):
        form = pteron.reduction.GRAPHS["virtual work" if key == "Eq. (13)" else "regressor"]
        entries = ca.SX.sym("parameters", columns.shape[1])
        function = ca.Function(
            "forces", [*flat, entries], [form(inverse, factors, columns, entries)]
        )
        kernels[key] = TARGETS["vm"](
            f"sparse, {key}",
            function,
            (*ports, Port("parameters", (columns.shape[1],), shared=True)),
            (Port("forces", (n,)),),
            {"parameters": values[which]},
        )
    return kernels


@dataclass(frozen=True)
class Dense:
    """The model as a reader of the paper would evaluate it: one full product after another.

    Parameters
    ----------
    jacobian : array, shape (b, m, m)
    blocks : list of (array, array, array)
        The Jacobian (b, r, m), the columns of Omega (b, r, k) that are kept, and their parameters
        (k,), of the sliders and of each link; the platform's Omega has no Jacobian.
    platform : array, shape (b, m, k)
    values : array
        One for each kept column.
    """

    jacobian: Array
    blocks: list[tuple[Array, Array, Array]]
    platform: Array
    values: Array

    @classmethod
    def of(cls, factors: Factors, kept: Sequence[int], values: Array) -> Dense:
        """Return the model for the columns that are kept."""
        jacobian, sliders, jacobians, links, platform = factors
        n, count = sliders.shape[-1], jacobians.shape[1]
        kept = list(kept)

        def kept_of(start: int, omega: Array) -> tuple[Array, Array]:
            columns = [k for k in kept if start <= k < start + omega.shape[-1]]
            places = [kept.index(k) for k in columns]
            matrix = np.ascontiguousarray(omega[..., [k - start for k in columns]])
            return matrix, values[places]

        blocks = [(jacobian, *kept_of(0, sliders))]
        for i in range(count):
            link = np.ascontiguousarray(jacobians[:, i])
            blocks.append((link, *kept_of(n + 4 * i, links[:, i])))
        return cls(jacobian, blocks, kept_of(n + 4 * count, platform)[0], values)

    def by_regressor(self) -> Array:
        """Return F_a = -J^-T [ J^T Om_p  J_u^T Om_u  J_l^T Om_l  Om_e ] P, shape (b, n)."""
        products = [np.swapaxes(j, -1, -2) @ omega for j, omega, _ in self.blocks]
        bracket = np.concatenate([*products, self.platform], axis=-1)
        transposed = np.swapaxes(self.jacobian, -1, -2)
        return np.asarray(-(np.linalg.solve(transposed, bracket) @ self.values))

    def body_by_body(self) -> Array:
        """Return F_a = -F_p - J^-T (sum J_b^T F_b + F_e), F_b = Om_b p_b, shape (b, n)."""
        (_, sliders, masses), *links = self.blocks
        total = self.platform @ self.values[-self.platform.shape[-1] :]
        for jacobian, omega, values in links:
            wrench = omega @ values
            total = total + (np.swapaxes(jacobian, -1, -2) @ wrench[..., None])[..., 0]
        transposed = np.swapaxes(self.jacobian, -1, -2)
        return np.asarray(
            -(sliders @ masses) - np.linalg.solve(transposed, total[..., None])[..., 0]
        )


if __name__ == "__main__":
    main()
