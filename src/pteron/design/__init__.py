"""Searches for the best dimensions of a machine, or the best machine, with proofs.

`search` and `survey` vary one machine as a `Spec` states; `choose_machine` varies the machines of
the catalog for a `Job`. The files of the package, each used by those below it:

- requirements: load_tables, workspace_tables, requirement_tables; `spec` with user_quantities and
  spec_faults, and `job`
- loads and errors: worst_cases, cycle_loads, tool_errors, joint_loads; `quantities`, by name
- a machine that varies: `paths`, `variables` and `task` of a spec; `kinds` of a job
- what a machine can do: `design` of a task; `rating` and kind_evaluator of a job, with
  workspace_samples, cycle_places, machine_space, structure, parts_room, limit_rows and
  load_margins
- proofs of both: `regions`, `proofs`
- searches: `evolution` has what both share; `rows`, `front`, `improvement`, `search`, `survey` of
  designs; kind_search, `candidate`, best_design, `choose` of kinds
- reports: `differences` and `report` of a front; `Candidate` and `Choice` contain their own
"""

from pteron.public import publish as _publish

_publish(__name__, checked=True)
