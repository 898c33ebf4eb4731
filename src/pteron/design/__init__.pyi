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
