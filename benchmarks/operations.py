"""Operation counts of every form of the inverse dynamics, from the compiled graphs.

Counts are of the expressions that are compiled, with shared subexpressions found; nothing is typed
in, and nothing depends on the machine that runs this.
"""

from __future__ import annotations

from measuring import quick

import pteron
from pteron.reduction import model_forms

_MACHINES = (
    *("quadrupteron", "quadrupteron-oblique", "tripteron", "tripteron-oblique"),
    *("delta", "delta-4", "linear-delta", "par4", "five-bar", "3-rrr"),
    *("stewart", "ball-table"),
)


def main() -> None:
    """Print the counts of machines of every family, and the ratios that are claimed."""
    print("Arithmetic operations of one state of the inverse dynamics")
    for name in ["delta"] if quick() else _MACHINES:
        robot = pteron.load(name)
        base = pteron.base_parameters(robot)
        forms = {key: kernel.operations for key, kernel in model_forms(base).items()}
        cheapest = pteron.reduction.cheapest_parameters(robot)
        complete, reduced = base.selection.shape[0], base.rank

        print(f"\n{name:<58}{f'{complete} parameters':>15}{f'{reduced} base':>12}")
        row("Eq. (15) as written, J^-T [...] P", *pair(forms, "regressor"))
        row("Eq. (15), J^-T last", *pair(forms, "regressor, J^-T last"))
        standard, factored = forms["factored", "complete"], forms["factored", "cheapest"]
        row("factored, parameters as inputs", standard, factored)
        folded = pteron.compile(robot, "inverse_dynamics").operations
        folded_base = pteron.compile(robot, "inverse_dynamics", base=cheapest).operations
        row("factored, the machine's numbers folded in (specialised)", folded, folded_base)
        general = pteron.compile(robot, "inverse_dynamics", grade="general").operations
        row("factored, geometry as an input too (general)", general, None)
        row("factored, the base parameters of `base_parameters`", *pair(forms, "factored"))
        row("Eq. (13), body by body", *pair(forms, "virtual work"))

        written = forms["regressor", "complete"]
        print(f"reduced against Eq. (15) as written: {fewer(factored, written)}")
        print(f"reduced against factored: {fewer(factored, standard)}")
        print(f"reduced and specialised against factored: {fewer(folded_base, standard)}")
        print(f"Eq. (15) reduced against complete: {fewer(forms['regressor', 'reduced'], written)}")


def pair(forms: dict[tuple[str, str], int], form: str) -> tuple[int, int]:
    """Return the counts with all parameters and with base parameters."""
    return forms[form, "complete"], forms[form, "reduced"]


def row(form: str, complete: int, reduced: int | None) -> None:
    """Print one form."""
    print(f"{form:<58}{complete:>15}{'' if reduced is None else reduced:>12}")


def fewer(count: int, reference: int) -> str:
    """Return how many per cent fewer operations that is."""
    return f"{count} against {reference}, {100.0 * (1.0 - count / reference):.1f} % fewer"


if __name__ == "__main__":
    main()
