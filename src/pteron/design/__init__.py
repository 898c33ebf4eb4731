"""Design: searches for a machine's best dimensions, with proofs of their results."""

from typing import TYPE_CHECKING

from pteron.arguments import check_arguments
from pteron.design.design import Design
from pteron.design.differences import Change
from pteron.design.front import Front
from pteron.design.proofs import (
    Proved,
    ProvedCube,
    cube_proofs,
    proved,
    proved_cube,
    start_design,
    workspace_proofs,
)
from pteron.design.quantities import Quantity, quantities
from pteron.design.report import ReportedDesign, Summary
from pteron.design.search import search
from pteron.design.spec import Spec, read_spec
from pteron.design.survey import survey
from pteron.design.task import Task
from pteron.design.variables import Variable
from pteron.renamed import former_names

__all__ = [
    "Change",
    "Design",
    "Front",
    "Proved",
    "ProvedCube",
    "Quantity",
    "Spec",
    "Summary",
    "Task",
    "ReportedDesign",
    "Variable",
    "cube_proofs",
    "proved",
    "proved_cube",
    "quantities",
    "read_spec",
    "search",
    "start_design",
    "survey",
    "workspace_proofs",
]
check_arguments(__name__)
if not TYPE_CHECKING:
    __getattr__ = former_names(__name__)


def __dir__() -> list[str]:
    return sorted(__all__)
