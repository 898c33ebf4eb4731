from pteron.kernels.bounds import (
    UNBOUNDED as UNBOUNDED,
    Bounded as Bounded,
    bounded_function as bounded_function,
    bounds as bounds,
)
from pteron.kernels.choice import numeric as numeric
from pteron.kernels.fields import (
    Field as Field,
    NoSquareRoot as NoSquareRoot,
    PrimeField as PrimeField,
    RationalField as RationalField,
    evaluate as evaluate,
)
from pteron.kernels.functions import FUNCTIONS as FUNCTIONS, needs_of as needs_of
from pteron.kernels.graph import Graph as Graph, graph_of as graph_of
from pteron.kernels.intervals import Enclosure as Enclosure
from pteron.kernels.kernel import (
    Array as Array,
    Kernel as Kernel,
    Port as Port,
    as_array as as_array,
    count_operations as count_operations,
)
from pteron.kernels.program_cache import Program as Program
from pteron.kernels.programs import (
    LOADED as LOADED,
    REDUCIBLE as REDUCIBLE,
    SELECTED as SELECTED,
    Columns as Columns,
    general_program as general_program,
    geometry_only as geometry_only,
    layout_of as layout_of,
    program as program,
    sharing_programs as sharing_programs,
    specialise_program as specialise_program,
)
from pteron.kernels.targets import (
    OTHER_LAYOUT as OTHER_LAYOUT,
    TARGETS as TARGETS,
    Selects as Selects,
    columns_of as columns_of,
    compile as compile,
    same_layout as same_layout,
)
