"""Searches for the best dimensions of a machine, or the best machine, with proofs.

`search` and `survey` vary one machine as a `Spec` asks, `choose_machine` those of the catalog as a
`Job` does. Its files, each used by those below it:

- what is asked: load_tables, workspace_tables, requirement_tables; `spec` with user_quantities and
  spec_faults, and `job`
- loads and errors: worst_cases, cycle_loads, tool_errors, drive_options; `quantities`, by name
- a machine that varies: `paths`, `variables` and `task` of a spec; `kinds` of a job
- what a machine can do: `design` of a task; `rating` of a job, with workspace_samples,
  cycle_places, machine_space and load_margins
- proofs of both: `regions`, `proofs`
- searches: `evolution` has what both share; `rows`, `front`, `improvement`, `search`, `survey` of
  designs; kind_search, `candidate`, best_design, `choose` of kinds
- in words: `differences` and `report` of a front; a `Candidate` and a `Choice` have their own
"""

from typing import TYPE_CHECKING

from pteron.public import publish as _publish

if TYPE_CHECKING:
    from pteron.design.candidate import Candidate as Candidate
    from pteron.design.choose import Choice as Choice, choose_machine as choose_machine
    from pteron.design.design import Design as Design
    from pteron.design.differences import Change as Change
    from pteron.design.front import Front as Front
    from pteron.design.job import Job as Job, read_job as read_job
    from pteron.design.proofs import (
        Proved as Proved,
        ProvedCube as ProvedCube,
        cube_proofs as cube_proofs,
        prove_design as prove_design,
        proved_cube as proved_cube,
        start_design as start_design,
        workspace_proofs as workspace_proofs,
    )
    from pteron.design.quantities import DesignQuantity as DesignQuantity, quantities as quantities
    from pteron.design.report import FrontReport as FrontReport, ReportedDesign as ReportedDesign
    from pteron.design.search import search as search
    from pteron.design.spec import Spec as Spec, read_spec as read_spec
    from pteron.design.survey import survey as survey
    from pteron.design.task import Task as Task
    from pteron.design.variables import Variable as Variable

_publish(__name__, checked=True)
