"""Operation counts of the dynamic model in each of its forms, complete and reduced, for the report.

How much a reduction saves depends on the form; `benchmarks/paper_claim.py` measures times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pteron.kernels import geometry_only
from pteron.kernels.program_cache import cached_result
from pteron.reduction import FORMS, BaseParameters, model_forms

PAPER_CLAIM = (  # Section 5 (d), Section 6
    "The paper makes two statements: the reduced model is approximately 41 % faster (section 5), "
    "which is 29 % less time, and it reduces the computation time by 41 % (conclusion). It says "
    "neither which original is meant nor how both were evaluated; that Eq. (15) with 40 columns is "
    "compared with Eq. (15) with the 26 of Table 1 is our reading. Evaluated matrix by matrix, the "
    "reduction then saves 30 to 33 % of the operations and, in our runs, 16 to 32 % of the time, "
    "which is 19 to 47 % faster: the first statement is right in size. As one graph with common "
    "subexpressions shared, it saves 13 to 16 % of the operations. Against Eq. (13), which forms "
    "no regressor, the reduced regressor takes more operations, not fewer. No reading that we "
    "tried gives the second statement."
)
"""The paper's statements on the speed of its reduced model, and the readings that figures support.

Documents, notebook and report quote it; a test holds its figures against the counts.
"""

_NAMES = {
    "dense": "Eq. (15), dense matrices",
    "virtual work": "Eq. (13), one graph",
    "regressor": "Eq. (15), graph, J^-T [...] P",
    "regressor, J^-T last": "Eq. (15), graph, J^-T last",
    "factored": "factored inverse dynamics",
}
"""Names of the forms on the page."""


@dataclass(frozen=True)
class Cost:
    """A form of the model: its name, operations per state, and a note on its reduction."""

    form: str
    operations: int
    note: str


def costs(base: BaseParameters) -> tuple[Cost, ...]:
    """Return the cost of every form, the complete one before the reduced one.

    The last is the factored form with the base parameters of least cost, which need not be those
    of `base`.
    """
    every = range(base.selection.shape[0])
    counts = cached_result(
        ("costs", geometry_only(base.robot), base.parameters, base.kept),
        ("kinematics", "reduction"),
        lambda: {key: kernel.operations for key, kernel in model_forms(base).items()},
    )
    counts["dense", "complete"] = dense_operations(base, every)
    counts["dense", "reduced"] = dense_operations(base, base.kept)
    table = []
    for form in ("dense", *FORMS):
        complete, reduced = counts[form, "complete"], counts[form, "reduced"]
        name, note = _NAMES[form], saving_text(reduced, complete)
        table.append(Cost(f"{name}, {len(every)} parameters", complete, ""))
        table.append(Cost(f"{name}, {base.rank} parameters", reduced, note))
    cheapest, complete = (counts["factored", which] for which in ("cheapest", "complete"))
    name = f"{_NAMES['factored']}, {base.rank} of least cost"
    table.append(Cost(name, cheapest, f"{saving_text(cheapest, complete)} than complete"))
    return tuple(table)


def saving_text(count: float, reference: float, less: str = "fewer") -> str:
    """Return the text of how many per cent a count is below a reference, or above it."""
    percent = 100.0 * (1.0 - count / reference)
    return f"{abs(percent):.0f} % {less if percent >= 0.0 else 'more'}"


def dense_operations(base: BaseParameters, base_columns: Sequence[int]) -> int:
    """Return the operations of Eq. (15) for some of its columns, with dense matrices.

    A product (a, b) (b, c) counts a c (2 b - 1), an elimination with c right sides about
    2 m^3 / 3 + 2 m^2 c. A leg's body that is a mass alone has a Jacobian of one row, other bodies
    one of six; the platform's columns need no product.
    """
    m: int = base.robot.freedom
    of_legs = [
        parameter for parameter in (base.parameters[k] for k in base_columns) if parameter.legs
    ]
    alone = sum(base.robot.legs[p.legs[0] - 1].bodies[p.body].kinds == ("m",) for p in of_legs)
    products = m * alone * (2 * m - 1) + m * (len(of_legs) - alone) * (2 * 6 - 1)
    elimination = round(2.0 * m * m * m / 3.0) + 2 * m * m * len(base_columns)
    return products + elimination + m * (2 * len(base_columns) - 1)
