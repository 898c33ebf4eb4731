"""Operation counts of the dynamic model in each of its forms, complete and reduced, for the report.

The paper says that its reduced model is about 41 % faster than the complete one. How much a
reduction saves depends on the form; `benchmarks/paper_claim.py` measures times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pteron.kernels.kept import kept_result
from pteron.reduction import FORMS, BaseParameters, model_forms

_NAMES = {
    "dense": "Eq. (15) as dense matrices",
    "regressor": "Eq. (15) as one graph, J^-T [...] P",
    "regressor, J^-T last": "Eq. (15) as one graph, J^-T last",
    "factored": "factored inverse dynamics",
}
"""Names of the forms on the page."""


@dataclass(frozen=True)
class Cost:
    """One form of the model: its name, operations for one state, and a note on its reduction."""

    form: str
    operations: int
    note: str


def costs(base: BaseParameters) -> tuple[Cost, ...]:
    """Return the cost of every form, the complete one before the reduced one."""
    every = range(base.selection.shape[0])
    counts = kept_result(
        ("costs", base.robot, base.parameters, base.kept),
        ("kinematics", "reduction"),
        lambda: {key: kernel.operations for key, kernel in model_forms(base).items()},
    )
    counts["dense", "complete"] = dense_operations(base, every)
    counts["dense", "reduced"] = dense_operations(base, base.kept)
    found = []
    for form in ("dense", *FORMS):
        complete, reduced = counts[form, "complete"], counts[form, "reduced"]
        name, note = _NAMES[form], f"{fewer(reduced, complete)} operations"
        found.append(Cost(f"{name}, {len(every)} parameters", complete, ""))
        found.append(Cost(f"{name}, {base.rank} parameters", reduced, note))
    return tuple(found)


def fewer(value: float, reference: float, less: str = "fewer") -> str:
    """Return in words the percentage by which a value is below, or above, a reference."""
    percent = 100.0 * (1.0 - value / reference)
    return f"{abs(percent):.0f} % {less if percent >= 0.0 else 'more'}"


def dense_operations(base: BaseParameters, kept: Sequence[int]) -> int:
    """Return the operations of Eq. (15) for some of its columns, every matrix taken as full.

    A product (a, b) (b, c) counts a c (2 b - 1), an elimination with c right sides about
    2 m^3 / 3 + 2 m^2 c. A leg's body that is a mass alone has a Jacobian of one row, other bodies
    one of six; the platform's columns need no product.
    """
    m: int = base.robot.freedom
    own = [parameter for parameter in (base.parameters[k] for k in kept) if parameter.legs]
    alone = sum(base.robot.legs[p.legs[0] - 1].bodies[p.body].kinds == ("m",) for p in own)
    products = m * alone * (2 * m - 1) + m * (len(own) - alone) * (2 * 6 - 1)
    elimination = round(2.0 * m * m * m / 3.0) + 2 * m * m * len(kept)
    return products + elimination + m * (2 * len(kept) - 1)
