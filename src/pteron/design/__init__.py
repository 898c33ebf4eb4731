"""Searches for the best dimensions of a machine, or the best machine, with proofs."""

from typing import TYPE_CHECKING

from pteron.public import publish as _publish

if TYPE_CHECKING:
    from pteron.design.choosing.candidate import Candidate as Candidate
    from pteron.design.choosing.choose import Choice as Choice, choose_machine as choose_machine
    from pteron.design.choosing.job import Job as Job, read_job as read_job
    from pteron.design.design import Design as Design
    from pteron.design.differences import Change as Change
    from pteron.design.front import Front as Front
    from pteron.design.proofs import (
        Proved as Proved,
        ProvedCube as ProvedCube,
        cube_proofs as cube_proofs,
        proved as proved,
        proved_cube as proved_cube,
        start_design as start_design,
        workspace_proofs as workspace_proofs,
    )
    from pteron.design.quantities import Quantity as Quantity, quantities as quantities
    from pteron.design.report import ReportedDesign as ReportedDesign, Summary as Summary
    from pteron.design.search import search as search
    from pteron.design.spec import Spec as Spec, read_spec as read_spec
    from pteron.design.survey import survey as survey
    from pteron.design.task import Task as Task
    from pteron.design.variables import Variable as Variable

_publish(__name__, checked=True)
