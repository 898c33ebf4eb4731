"""Results of all functions: equal results are equal, and all are shown and tabled alike."""

import importlib
import inspect
import pickle
import pkgutil
import subprocess
import sys
import typing
from dataclasses import fields, is_dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import polars as pl
from logs_of_motions import log_of
from mechanisms import CLIENTS

import pteron
from pteron import calibration, design, identification, indices, kinematics, maps, motion, workspace
from pteron.controllers import ComputedTorque
from pteron.identification import States, excitation
from pteron.json_values import json_text
from pteron.plots.films import Film
from pteron.result import Result

HOME = [0.0, 0.12]
"""A pose of the five-bar."""


@cache
def _cycle():
    return motion.pick_and_place("five-bar", HOME, scale=0.2, samples=41)


@cache
def _sizing():
    return motion.size("five-bar", _cycle())


@cache
def _paving():
    return workspace.paving("five-bar", HOME, tolerance=0.1)


@cache
def _map():
    robot = pteron.load("five-bar")
    return maps.map_index(robot, "condition", maps.pose_grid(robot, points=7))


def _surfaces():
    grid = maps.pose_grid("tripteron", {}, points=5)
    return maps.surfaces(maps.map_index("tripteron", "margin", grid), "margin")


def _fastest():
    robot = pteron.load("five-bar")
    path = motion.line_path(robot, [HOME, [0.01, 0.125]])
    return motion.time_optimal(robot, path, motion.limits_of(robot, force=5.0, speed=1.0))


def _observations():
    robot = pteron.load("five-bar")
    log = log_of(robot, size=0.01)
    model = identification.identification_model("five-bar")
    return identification.observations_of(
        model, log, identification.preprocessing_for_log(robot, log)
    )


def _calibration():
    robot = pteron.load("linear-delta")
    poses = pteron.random_poses(robot, 40)
    readings = pteron.inverse_kinematics(robot, poses) + np.array([0.001, 0.0, 0.0])
    measured = calibration.Measurements.from_readings(robot, readings, poses=poses)
    return calibration.calibrate(robot, measured, free=["zeros"])


def _fit():
    t = np.linspace(0.0, 10.0, 1000)
    regressor = np.column_stack([np.sin(t), np.cos(3.0 * t)])
    forces = regressor @ [0.2, 0.5] + 0.01 * np.random.default_rng(0).normal(size=t.shape)
    names, units = ["a", "b", "c"], ["N"] * 3
    regressor = np.column_stack([regressor, regressor[:, :1]])
    return identification.estimate(regressor, forces, names=names, units=units, reduce=True)


@cache
def _front():
    parts = {
        "robot": "five-bar",
        "variables": [{"moves": "legs.upper_length", "range": (0.08, 0.12)}],
        "objectives": [{"maximise": "cube"}, {"minimise": "links"}],
        "search": {"population": 4, "generations": 1, "refined": 0},
    }
    return design.search(design.Spec.model_validate(parts))


def _choice():
    parts = {
        "workspace": {"size": [0.1, 0.05]},
        "payload": {"mass": 0.1},
        "cycles": [{"points": [[-0.04, 0.0], [0.04, 0.0]], "duration": 0.5}],
        "kinds": ["five-bar"],
        "search": {"evaluations": 20},
    }
    return design.choose_machine(design.Job.model_validate(parts))


def _identification():
    robot = pteron.load("five-bar")
    log, other = (log_of(robot, size=0.01, period=period) for period in (3.0, 4.0))
    return identification.identify(robot, log, held_out=other)


def _states():
    robot = pteron.load("five-bar")
    joints = pteron.inverse_kinematics(robot, _cycle().pose)
    rest = np.zeros_like(joints)
    return States.from_joints(robot, (joints, rest, rest), _cycle().time, HOME)


def _parameters_of_drives():
    estimate, numbers = _fit().estimate, np.ones(2)
    return (
        identification.DriveGains(*[numbers] * 3, "N m/A", estimate, numbers, 1.0, 1.0),
        identification.Transmissions(*[numbers] * 6),
    )


def _cue():
    time = np.linspace(0.0, 1.0, 201)
    columns = {"t": time, "ax": np.sin(time), "ay": 0.0 * time, "az": 0.0 * time}
    columns |= dict.fromkeys(("wx", "wy", "wz"), 0.0 * time)
    return motion.cue("stewart", columns)


def _rest():
    return np.array([[0.0, 0.0, -0.8]]), np.zeros((1, 3)), np.zeros((1, 3))


def _payload():
    robot = pteron.load("five-bar")
    logs = (log_of(one, size=0.01) for one in (robot, motion.with_payload(robot, 0.2)))
    return identification.identify_payload(robot, *logs)


@cache
def _excitation():
    return excitation.optimal_excitation("five-bar", period=3.0, harmonics=2, starts=1, seed=1)


_MOTOR = motion.Motor("200 W", 3e-5, 0.64, 1.9, 600.0)

MADE = {
    "architecture": lambda: kinematics.architecture("five-bar"),
    "base": lambda: pteron.base_parameters("five-bar", "qr"),
    "base, exact": lambda: pteron.base_parameters("five-bar"),
    "batch": lambda: motion.simulate_many(
        motion.machines_about("five-bar", 2, masses=0.1), _cycle(), ComputedTorque(), duration=0.01
    ),
    "calibration": _calibration,
    "choice": _choice,
    "clearance": lambda: workspace.clearance("delta", [0.0, 0.0, -0.8]),
    "components": lambda: workspace.components(_paving()),
    "conditioning": lambda: indices.global_conditioning("five-bar", HOME, count=256),
    "contacts": lambda: workspace.mode_contacts(
        workspace.mode_pavings("five-bar", HOME, tolerance=0.2)
    ),
    "cue": _cue,
    "cue limits": lambda: motion.cue_limits("stewart"),
    "cube": lambda: workspace.largest_cube("five-bar", HOME),
    "drives": _parameters_of_drives,
    "excitation": lambda: (_excitation(), _excitation().with_leads(), _excitation().held_out()),
    "film": lambda: Film(Path("delta.gif"), 3, 25.0, 1.0, (320, 240)),
    "fault": lambda: identification.IsolatedFault(
        "delay", ("1",), np.ones(1), np.ones(1), 0.0, 0.1, np.zeros(1)
    ),
    "findings": lambda: (
        calibration.CalibrationFinding("drift", "The readings drift."),
        calibration.HiddenOrder((1, 2), 1e-3),
        motion.CyclePlace((0.0, 0.12)),
    ),
    "fit": _fit,
    "free region": lambda: workspace.free_of_singularities(
        "five-bar", [[0.0, 0.12], [0.005, 0.125]]
    ),
    "front": _front,
    "home": lambda: workspace.home_poses("five-bar"),
    "identification": _identification,
    "joint motion": lambda: kinematics.joint_rates("five-bar", HOME, [0.1, 0.0]),
    "joint ranges": lambda: workspace.joint_ranges("five-bar", [HOME, [0.01, 0.12]]),
    "joints with limits": lambda: workspace.limited_joints("stewart", [0.0, 0.0, 0.6, 0, 0, 0]),
    "linear plant": lambda: motion.linearise("five-bar", HOME),
    "map": _map,
    "margins": lambda: workspace.pose_margins("five-bar", [HOME, [0.01, 0.12]]),
    "motion": _cycle,
    "motor": lambda: motion.choose_common(_sizing(), [_MOTOR]),
    "observations": _observations,
    "paving": _paving,
    "redundancy": lambda: workspace.redundancy("3-rrr-point", [0.3, 0.25]),
    "payload": _payload,
    "peaks": lambda: motion.peaks(
        pteron.load("delta"), *_rest(), motion.limits_of(pteron.load("delta"), force=5.0)
    ),
    "plan": lambda: calibration.plan("linear-delta", 8),
    "pose error": lambda: indices.pose_error("five-bar", HOME, indices.Tolerances(joints=1e-4)),
    "proved poses": lambda: workspace.proved_poses("five-bar", [0.3, 0.3]),
    "proof": lambda: workspace.prove("five-bar", workspace.Box((0.0, 0.12), (0.005, 0.125))),
    "reactions": lambda: indices.reactions("five-bar", HOME),
    "report": lambda: (report := design.FrontReport(_front()), report.selection[-1].changes),
    "reported designs": lambda: [
        (reported, reported.design) for reported in design.FrontReport(_front()).selection
    ],
    "proved": lambda: design.prove_design(design.start_design(_front().task)),
    "sensitivities": lambda: indices.geometric_sensitivities("five-bar", HOME),
    "simulation": lambda: motion.simulate("five-bar", _cycle(), ComputedTorque(), duration=0.01),
    "singularity": lambda: workspace.nearest_singularities("five-bar", HOME),
    "quadrature": lambda: workspace.quadrature_volume("five-bar", HOME, lines=20),
    "sizing": lambda: (
        _sizing(),
        motion.DriveMargin(1, "max_force", "peak_force", 2.0, 1.0, "N"),
    ),
    "slice": lambda: workspace.reach_slice("five-bar", HOME, points=9),
    "states": _states,
    "statistics": lambda: _map().statistics("condition"),
    "stiffness": lambda: indices.stiffness("five-bar", HOME, indices.Elasticity(actuators=1e4)),
    "travel": lambda: workspace.travel("five-bar", [0.0, 0.12]),
    "tilt": lambda: workspace.largest_tilt("stewart", [0.0, 0.0, 0.6, 0, 0, 0], tolerance=0.1),
    "surfaces": _surfaces,
    "time-optimal": _fastest,
    "trial": lambda: motion.trial("five-bar", _cycle(), ComputedTorque()),
    "tuning": lambda: motion.tune("five-bar", poses=[HOME]),
    "volume": lambda: workspace.reach_volume("five-bar", HOME, count=500),
    "volumes": lambda: workspace.volumes_over_angles(
        "3-prr", [0.0, 0.0, 0.0], [0.0, 0.5], tolerance=0.3
    ),
}
"""Calls that return results of every class."""

NO_RESULTS = {
    *(
        "Manipulator",
        "Parameter",
        "PlanarInertia",
        "Platform",
        "SpatialInertia",
        "Tool",
    ),  # machines
    *("ActuatedJoint", "Controller", "Drive", "Elastic", "Motor", "Section"),  # parts of machines
    *("Axis", "Box", "Grid", "Index", "LinearLimits", "Machines", "MotionLimits"),  # what is asked
    *("DesignQuantity", "Limits", "LinePath", "Measurements", "Model", "Task"),
    *(
        "Clock",
        "Description",
        "Dialect",
        "KnownPayload",
        "Log",
        "SampleBlock",
        "Table",
    ),  # read from files
    *("CustomLaw", "ExportedCustomLaw", "ExportedLaw", "Law"),  # controllers at work
    *("CentralDifferences", "Decimation", "FittedSeries", "FourierFit", "SmoothingSpline"),
    *("Bounded", "Enclosure", "Graph", "Program", "QrFactor"),  # of those who write programs
    *("EpisodeState", "ViewerState", "Tree", "TreeJoint", "Guide", "JointPoints"),  # other programs
    *("CalibrationRow", "FirmwareFit", "ReportedParameter", "Written"),  # of pages
    *("Condition", "Fit"),
}
"""Classes that public functions return and that are no results: who calls gives them on."""


def _functions():
    """Yield every public function and method of the package, with the names it is defined among."""
    packages = [m.name for m in pkgutil.walk_packages(pteron.__path__, "pteron.") if m.ispkg]
    for name in ["pteron", *packages]:
        if name.startswith(("pteron.cli", "pteron._")):
            continue
        package = importlib.import_module(name)
        for public in getattr(package, "__all__", ()):
            part = getattr(package, public)
            members = [*vars(part).values()] if inspect.isclass(part) else [part]
            for member in members:
                function = getattr(member, "fget", getattr(member, "__func__", member))
                if inspect.isfunction(inspect.unwrap(function)):
                    yield inspect.unwrap(function)


def _classes(hint):
    if is_dataclass(hint):
        yield hint
    for part in typing.get_args(hint):
        yield from _classes(part)


def _returned_classes():
    """Return the dataclasses that public functions return, or containers of them."""
    classes = set()
    for function in _functions():
        hint = function.__annotations__.get("return")
        try:
            if isinstance(hint, str):
                hint = eval(hint, vars(sys.modules[function.__module__]))
        except NameError:  # what a type checker alone imports
            continue
        classes |= set(_classes(hint))
    return classes


def test_what_public_functions_return_is_a_result():
    others = {c for c in _returned_classes() if not issubclass(c, Result)}
    assert {c.__name__ for c in others} - NO_RESULTS == set()
    assert len(_returned_classes() - others) > 50


@cache
def _results():
    """Return a result of every class, those inside others too, by their classes."""
    results = {}

    def collect(part):
        if isinstance(part, Result):
            results.setdefault(type(part), part)
        if is_dataclass(part) and not isinstance(part, pteron.Manipulator):
            part = [getattr(part, field.name) for field in fields(part)]
        for each in part if isinstance(part, tuple | list) else ():
            collect(each)

    for make in MADE.values():
        collect(make())
    return results


@CLIENTS
def test_results_compare_hash_print_and_have_tables():
    for kind, result in _results().items():
        name, again = kind.__name__, pickle.loads(pickle.dumps(result))
        assert again == result, name
        assert hash(again) == hash(result), name
        assert result != object(), name
        line = repr(result)
        assert line.startswith(f"<{name}"), line
        assert line.endswith(">"), line
        assert len(line) < 100, line
        assert "\n" not in line, name
        assert json_text(result.as_dict()), name
        assert isinstance(result.summary(), str), name
        table = result.table()
        assert isinstance(table, pl.DataFrame), name
        assert len(set(table.columns)) == len(table.columns) > 0, name
        assert result._repr_html_(), name


@CLIENTS
def test_every_class_of_results_is_among_these():
    def subclasses(kind):
        for each in kind.__subclasses__():
            yield each
            yield from subclasses(each)

    others = {kind for kind in subclasses(Result) if kind.__module__.startswith("pteron")}
    assert {kind.__name__ for kind in others - {*_results()}} == {"Certificate"}  # abstract


@CLIENTS
def test_results_that_differ_in_a_number_are_not_equal():
    tried = 0
    for kind, result in _results().items():
        for field in fields(result):
            part = getattr(result, field.name)
            numbers = isinstance(part, float | int) and not isinstance(part, bool)
            numbers |= isinstance(part, np.ndarray) and part.dtype.kind == "f" and part.size > 0
            if numbers and field.compare and np.isfinite(part).all():
                assert replace(result, **{field.name: part + 1}) != result, (kind, field.name)
                tried += 1
                break
    assert tried > 40


@CLIENTS
def test_functions_take_the_columns_of_tables():
    robot = pteron.load("five-bar")
    cycle, plan = _cycle(), _results()[calibration.Plan]
    table = cycle.table_for(robot)
    assert (
        pteron.inverse_kinematics(robot, table) == pteron.inverse_kinematics(robot, cycle.pose)
    ).all()
    forces = pteron.inverse_dynamics(robot, table, table, table)
    motion_parts = cycle.pose, cycle.velocity, cycle.acceleration
    assert (forces == pteron.inverse_dynamics(robot, *motion_parts)).all()
    assert np.allclose(pteron.inverse_kinematics(plan.robot, plan.table()), plan.readings)
    states = _results()[States].table_for(robot)
    assert np.allclose(pteron.inverse_kinematics(robot, states), _results()[States].joints)
    cube = _results()[workspace.Inscribed]
    assert workspace.pose_margins(robot, cube.table()) == workspace.pose_margins(
        robot, [cube.center]
    )
    simulation = _results()[motion.Simulation].table()
    assert pteron.inverse_kinematics(robot, simulation).shape == (len(simulation), 2)


def test_a_result_without_a_machine_numbers_its_columns():
    assert _cycle().table().columns[:3] == ["t", "pose_1", "pose_2"]
    assert _cycle().table_for(pteron.load("five-bar")).columns[:3] == ["t", "x", "y"]


def test_rows_of_several_results_have_the_columns_of_all():
    fault = identification.IsolatedFault(
        "delay", ("1",), np.ones(1), np.ones(1), 0.0, 0.1, np.zeros(1)
    )
    none = np.zeros(1)
    faults = (fault, replace(fault, speeds=np.array([0.1, 0.2])))
    table = identification.FaultIsolation((), faults, none, none).table()
    assert table["speeds_2"].to_list() == [None, 0.2]
    assert identification.FaultIsolation((), (), none, none).table().height == 0


def test_nan_equals_nan_and_other_shapes_do_not():
    margins = workspace.pose_margins("five-bar", [HOME, [0.01, 0.12]])
    unknown = replace(margins, least=np.full(2, np.nan))
    assert unknown == replace(margins, least=np.full(2, np.nan))
    assert hash(unknown) == hash(replace(margins, least=np.full(2, np.nan)))
    assert unknown != margins
    assert workspace.pose_margins("five-bar", [HOME]) != margins


def test_a_hash_is_the_same_in_every_process():
    """Else sets of results, and what comes first in them, would differ from run to run."""
    code = "from pteron.motion import CyclePlace; print(hash(CyclePlace((0.1, -0.2), 0.3)))"
    hashes = {
        subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout
        for _ in range(3)
    }
    assert len(hashes) == 1
