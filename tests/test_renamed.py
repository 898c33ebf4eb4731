"""Former public names: each answers with what it is called now, and says so."""

import importlib
from types import SimpleNamespace

import pytest

import pteron
from pteron.controllers import Controller
from pteron.design import (
    Candidate,
    Change,
    Choice,
    Design,
    Front,
    FrontReport,
    ReportedDesign,
    Spec,
    Task,
)
from pteron.export.engines import TreeJoint
from pteron.identification import FaultIsolation, Identification, Payload
from pteron.indices import Elasticity, Stiffness
from pteron.legs import LegKind
from pteron.maps import Grid, Map, TableStore
from pteron.motion import DriveMargin, Guide, Motor, Sizing, Span
from pteron.platforms import Platform
from pteron.renamed import RENAMED, UNTIL
from pteron.workspace import LimitedJoint, PoseMargins

NAMES = [(package, old, new) for package, names in RENAMED.items() for old, new in names.items()]


@pytest.mark.parametrize(("package", "old", "new"), NAMES)
def test_a_former_name_answers_with_a_line_that_runs(package, old, new):
    """The warning is of the user's own line."""
    with pytest.warns(DeprecationWarning, match=rf"^{package}\.{old} goes with version") as told:
        found = getattr(importlib.import_module(package), old)
    assert told[0].filename == __file__
    space = {}
    exec(str(told[0].message).partition("; write ")[2], space)
    assert space[new.rpartition(".")[2]] is found


@pytest.mark.parametrize(("package", "old"), [(package, old) for package, old, _ in NAMES])
def test_a_former_name_is_not_listed(package, old):
    module = importlib.import_module(package)
    assert old not in dir(module)
    assert old not in getattr(module, "__all__", ())  # of packages


@pytest.mark.parametrize("package", RENAMED)
def test_another_name_is_unknown(package):
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'speling'"):
        _ = importlib.import_module(package).speling


def test_former_names_are_gone_when_their_release_is_over():
    assert [*map(int, pteron.__version__.split(".")[:2])] < [*map(int, UNTIL.split("."))]


def test_a_former_method_of_a_class_answers_too():
    with pytest.warns(
        DeprecationWarning, match=r"^Task\.of goes with version .*write \.from_spec$"
    ):
        assert Task.of == Task.from_spec


@pytest.mark.parametrize(
    ("owner", "old", "new"),
    [
        (Identification, "trial", "fault_isolation"),
        (Payload, "trial", "fault_isolation"),
        (FaultIsolation, "suspicions", "faults"),
        (Design, "reserve", "margin"),
        (Design, "start_strokes", "reference_strokes"),
        (PoseMargins, "clearances", "joints"),
        (PoseMargins, "smallest", "least"),
        (LimitedJoint, "told_limits", "limits_text"),
        (Design, "carrying", "loaded_robot"),
        (Design, "lack", "missing_reason"),
        (Design, "reached", "is_reachable"),
        (Design, "sizing", "cycle_loads"),
        (Change, "by", "relative_change"),
        (Change, "shown", "format_value"),
        (Change, "told", "format_value"),
        (Front, "chosen", "selection"),
        (FrontReport, "chosen", "selection"),
        (FrontReport, "data", "as_dict"),
        (Choice, "data", "as_dict"),
        (Candidate, "data", "as_dict"),
        (ReportedDesign, "lacking", "missing_quantities"),
        (Spec, "asked", "quantity_names"),
        (Task, "asked", "quantity_names"),
        (Grid, "held", "fixed_coordinates"),
        (Map, "at", "slice_at"),
        (TableStore, "finished", "finished_chunks"),
        (Sizing, "at", "select_place"),
        (Sizing, "where", "place_text"),
        (Span, "within", "intersect"),
        (DriveMargin, "told", "overload_text"),
        (Motor, "doubts", "warnings"),
        (Platform, "at", "placement"),
        (Platform, "turned", "map_vectors"),
        (LegKind, "under", "with_platform_frame"),
        (Stiffness, "along", "directional_stiffness"),
        (Guide, "slides", "is_prismatic"),
        (TreeJoint, "slides", "is_prismatic"),
        (Elasticity, "of_legs", "leg_springs"),
    ],
)
def test_a_former_attribute_answers_with_what_to_write(owner, old, new):
    stand_in = type(owner.__name__, (SimpleNamespace,), {old: vars(owner)[old]})(**{new: "value"})
    words = rf"^{owner.__name__}\.{old} goes with version {UNTIL}; write \.{new}$"
    with pytest.warns(DeprecationWarning, match=words):
        assert getattr(stand_in, old) == "value"
    assert hasattr(owner, new) or new in owner.__dataclass_fields__


def test_a_method_under_its_former_name_serves_with_what_to_define():
    with pytest.warns(
        DeprecationWarning, match=rf"^Own\.what .* {UNTIL}; define law_name instead$"
    ):

        class Own(Controller):
            what = "pd_gravity"

    assert Own.law_name == "pd_gravity"
