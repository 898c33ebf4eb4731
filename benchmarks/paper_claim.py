"""The paper says its reduced model is about 41 % faster: in which form, and by how much.

Prints the model's forms, complete and reduced, side by side: operations counted from the graphs,
times measured in one run with the rounds taking turns. Times are of this machine; ratios carry.
"""

from __future__ import annotations

import platform

import casadi
import numpy as np

import pteron
from pteron.report.costs import costs


def main() -> None:
    """Print the table for every machine of the catalog."""
    print(
        f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, ",
        end="",
    )
    print(f"NumPy {np.__version__}, CasADi {casadi.__version__}, Pteron {pteron.__version__}")
    for name in pteron.catalog():
        print(f"\n{name:<58}{'operations':>12}{'us a state':>12}  reduced against complete")
        for cost in costs(pteron.base_parameters(pteron.load(name))):
            print(f"{cost.form:<58}{cost.operations:>12}{cost.microseconds:>12.2f}  {cost.note}")


if __name__ == "__main__":
    main()
