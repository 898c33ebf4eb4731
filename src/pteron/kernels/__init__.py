"""CasADi expressions made executable ("kernels"): by CasADi, Numba, C, JAX, fractions, intervals.

Batches of states, threads and the cache of compiled code live here and only here.
"""

from pteron.arguments import check_arguments
from pteron.kernels.bounds import Bounded, bounded, bounds
from pteron.kernels.choice import numeric
from pteron.kernels.fields import Field, NoSquareRoot, PrimeField, RationalField, evaluate
from pteron.kernels.functions import FUNCTIONS, needs_of
from pteron.kernels.graph import Graph, graph_of
from pteron.kernels.intervals import Enclosure
from pteron.kernels.kept import Program
from pteron.kernels.kernel import Array, Kernel, Port, as_array, count_operations
from pteron.kernels.programs import (
    LOADED,
    REDUCIBLE,
    SELECTED,
    Columns,
    bare,
    general_program,
    program,
    specialised,
)
from pteron.kernels.targets import (
    OTHER_LAYOUT,
    TARGETS,
    Selects,
    columns_of,
    compile,
    same_layout,
)

__all__ = [
    "FUNCTIONS",
    "LOADED",
    "OTHER_LAYOUT",
    "REDUCIBLE",
    "SELECTED",
    "Selects",
    "needs_of",
    "TARGETS",
    "Array",
    "Bounded",
    "Columns",
    "Enclosure",
    "Field",
    "Graph",
    "Kernel",
    "NoSquareRoot",
    "Port",
    "PrimeField",
    "Program",
    "RationalField",
    "as_array",
    "bare",
    "bounded",
    "bounds",
    "columns_of",
    "compile",
    "count_operations",
    "evaluate",
    "general_program",
    "graph_of",
    "numeric",
    "program",
    "same_layout",
    "specialised",
]
# The others serve the floors above, in inner loops.
check_arguments(__name__, ("bounded", "bounds", "compile"))


def __dir__() -> list[str]:
    return sorted(__all__)
