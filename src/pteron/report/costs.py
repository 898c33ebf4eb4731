"""What the dynamic model costs in each of its forms: operations counted, time measured.

The paper says that its reduced model is about 41 % faster than the complete one. How much a
reduction saves depends on the form: all of them stand side by side here, measured in one run.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from pteron.kernels import Array, numeric
from pteron.kinematics import random_poses
from pteron.reduction import FORMS, BaseParameters, model_forms
from pteron.report.dense import DenseModel

__all__ = ["Cost", "costs"]

_STATES = 1024
_ROUNDS = 15

_FORM_NAMES = {
    "regressor": "Eq. (15) as one graph, J^-T [...] P",
    "regressor, J^-T last": "Eq. (15) as one graph, J^-T last",
    "factored": "factored inverse dynamics",
}


@dataclass(frozen=True)
class Cost:
    """One form of the model.

    Attributes
    ----------
    form : str
        What is evaluated.
    operations : int
        Arithmetic operations of one state: counted from the graph, or, where matrices are dense,
        for full matrices and without those that fill them.
    microseconds : float
        Time of one state in a batch: the median of interleaved rounds.
    note : str
        What it says about a reduction, against the row before it.
    """

    form: str
    operations: int
    microseconds: float
    note: str


def costs(base: BaseParameters, seed: int = 0) -> tuple[Cost, ...]:
    """Return what the model costs in each form, complete and reduced.

    Parameters
    ----------
    base : BaseParameters
        The base parameters, and with them the machine.
    seed : int
        Of the random states.

    Returns
    -------
    tuple of Cost
        In pairs, the complete form before the reduced one: dense matrices; the regressor as a graph
        with shared subexpressions; the factored inverse dynamics.
    """
    rng = np.random.default_rng(seed)
    pose = random_poses(base.robot, _STATES, seed=rng)
    state = pose, rng.normal(size=pose.shape), rng.normal(size=pose.shape)
    kernels = model_forms(base)
    runs: dict[tuple[str, str], Callable[[], object]] = {}
    terms = numeric(base.robot, "paper_terms")(*state)
    operations = {}
    for name, reduced in (("complete", False), ("reduced", True)):
        model = DenseModel.of(base, reduced)
        runs["dense", name] = partial(model.forces, model.cut(terms))
        operations["dense", name] = model.operations
    for key, kernel in kernels.items():
        runs[key] = partial(kernel, *state)
        operations[key] = kernel.operations
    seconds = _interleaved(runs)

    columns = {"complete": base.selection.shape[0], "reduced": base.rank}
    names = {"dense": "Eq. (15) as dense matrices", **{f: _FORM_NAMES[f] for f in FORMS}}
    found = []
    for form, name in names.items():
        for which in ("complete", "reduced"):
            note = ""
            if which == "reduced":
                # Pair by pair: what slows the machine for a while slows both runs of a round.
                ratio = np.median(seconds[form, which] / seconds[form, "complete"])
                share = operations[form, which] / operations[form, "complete"]
                note = f"{_change(share, 'fewer')} operations, {_change(float(ratio), 'less')} time"
            found.append(
                Cost(
                    f"{name}, {columns[which]} parameters",
                    operations[form, which],
                    1e6 * float(np.median(seconds[form, which])) / _STATES,
                    note,
                )
            )
    return tuple(found)


def _interleaved(runs: dict[tuple[str, str], Callable[[], object]]) -> dict[tuple[str, str], Array]:
    """Return the seconds of each run in every round; the runs take turns."""
    times: dict[tuple[str, str], list[float]] = {key: [] for key in runs}
    for _ in range(_ROUNDS):
        for key, run in runs.items():
            start = time.perf_counter()
            run()
            times[key].append(time.perf_counter() - start)
    return {key: np.array(values) for key, values in times.items()}


def _change(ratio: float, word: str) -> str:
    percent = 100.0 * (1.0 - ratio)
    return f"{abs(percent):.0f} % {word if percent >= 0 else 'more'}"
