"""Tables where arrays are expected: columns count by their names, in any order."""

import numpy as np
import pandas as pd
import polars as pl
import pytest
from mechanisms import CLIENTS, gated

import pteron
from pteron.errors import DataError
from pteron.kernels import as_array
from pteron.tables import Table

MACHINES = ("quadrupteron", "delta", "five-bar", "3-rrr")


def motion_of(robot, rows=4):
    """Return poses, velocities, accelerations and wrenches (rows, m) of a machine."""
    poses = pteron.random_poses(robot, rows, seed=2)
    rng = np.random.default_rng(1)
    return poses, *rng.normal(size=(3, rows, robot.freedom))


def columns_of(robot, parts):
    """Return a motion as columns, in an order of their own, with others among them."""
    names = robot.column_names
    blocks = zip(("pose", "velocity", "acceleration", "wrench"), parts, strict=True)
    found = {n: v for kind, part in blocks for n, v in zip(names[kind], part.T, strict=True)}
    mixed = dict(sorted(found.items(), key=lambda item: item[0][::-1]))
    return {"remark": np.arange(len(parts[0])), **mixed, "t": 0.1 * np.arange(len(parts[0]))}


FORMS = {
    "pandas": pd.DataFrame,
    "polars": pl.DataFrame,
    "mapping": dict,
    "lists": lambda columns: {name: list(values) for name, values in columns.items()},
    "file": lambda columns: Table("a file", pl.DataFrame(columns)),
    "records": lambda columns: pd.DataFrame(columns).to_records(index=False),
    "labels": lambda columns: pd.DataFrame(columns).to_xarray().to_dataarray("of").T,
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", MACHINES)
def test_columns_are_read_by_their_names_in_any_order(name, form):
    robot = pteron.load(name)
    parts = motion_of(robot)
    table = FORMS[form](columns_of(robot, parts))
    expected = pteron.inverse_dynamics(robot, *parts)
    assert (pteron.inverse_dynamics(robot, *[table] * 4) == expected).all()
    joints = pteron.inverse_kinematics(robot, parts[0])
    assert (pteron.inverse_kinematics(name, table) == joints).all()
    named = FORMS[form](dict(zip(robot.joint_names, joints.T, strict=True)))
    np.testing.assert_array_equal(
        pteron.direct_kinematics(robot, named), pteron.direct_kinematics(robot, joints)
    )
    forces = dict(zip(robot.force_names, expected.T, strict=True))
    forces = FORMS[form](columns_of(robot, parts) | forces)
    back = pteron.forward_dynamics(robot, forces, forces, forces, forces)
    np.testing.assert_allclose(back, parts[2], rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("target", gated(["vm", "numba", "c", "jax"], ["vm"], CLIENTS))
def test_every_compiled_kernel_takes_tables(target):
    robot = pteron.load("delta")
    parts = motion_of(robot)[:3]
    kernel = pteron.compile(robot, "inverse_dynamics", target)
    table = pd.DataFrame(columns_of(robot, motion_of(robot)))
    assert (np.asarray(kernel(*[table] * 3)) == np.asarray(kernel(*parts))).all()


def test_a_row_is_a_state():
    robot = pteron.load("quadrupteron")
    parts = motion_of(robot)
    row = pd.DataFrame(columns_of(robot, parts)).iloc[2]
    first = {name: float(values[2]) for name, values in columns_of(robot, parts).items()}
    expected = pteron.inverse_dynamics(robot, *(part[2] for part in parts))
    for one in (row, first):
        assert pteron.inverse_dynamics(robot, *[one] * 4).shape == (4,)
        np.testing.assert_allclose(pteron.inverse_dynamics(robot, *[one] * 4), expected, rtol=1e-14)


@pytest.mark.parametrize("name", MACHINES)
def test_where_the_joints_are_is_read_by_names_too(name):
    robot = pteron.load(name)
    poses = motion_of(robot)[0]
    table = pd.DataFrame(columns_of(robot, motion_of(robot)))
    expected = pteron.motion.joint_points(robot, poses)
    assert (pteron.motion.joint_points(robot, table).chain == expected.chain).all()
    reverse = table[list(robot.coordinates)[::-1]]
    assert (pteron.motion.joint_points(robot, reverse).tool == expected.tool).all()


def test_a_table_of_one_row_is_one_pose():
    robot = pteron.load("delta")
    home = pteron.workspace.home_pose(robot)
    table = pd.DataFrame({"note": ["home"], "z": home[2], "y": home[1], "x": home[0]})
    limited = pteron.workspace.limited_joints
    assert limited(robot, table) == limited(robot, home)
    assert limited(robot, table.iloc[0]) == limited(robot, home)
    cycle = pteron.motion.pick_and_place(robot, table)
    assert (cycle.pose == pteron.motion.pick_and_place(robot, home).pose).all()
    box = pteron.workspace.bounding_box
    assert (box(robot, table) == box(robot, home)).all()
    several = {"x": [0.0, 0.1], "y": 0.0, "z": -0.9}
    for call in (pteron.motion.pick_and_place, pteron.motion.least_margin, box, limited):
        with pytest.raises(DataError, match="2 poses given, 1 expected"):
            call(robot, several)


def test_a_table_without_names_is_an_array():
    robot = pteron.load("delta")
    poses = motion_of(robot)[0]
    assert (pteron.jacobian(robot, pd.DataFrame(poses)) == pteron.jacobian(robot, poses)).all()
    assert (pteron.jacobian(robot, pd.Series(poses[0])) == pteron.jacobian(robot, poses[0])).all()


def test_a_table_with_names_is_refused_where_their_order_is_not_known():
    frame = pd.DataFrame({"z": [1.0, 1.0], "y": [2.0, 2.0], "x": [3.0, 3.0]})
    with pytest.raises(DataError, match="x: a table with names given, an array expected"):
        as_array(frame, "x", (3,))
    with pytest.raises(DataError, match=r"motion\.pose: a table with names given"):
        pteron.motion.Motion([0.0, 1.0], frame, frame, frame)
    with pytest.raises(DataError, match="log: joints: a table with names given"):
        pteron.identification.Log("log", [0.0, 1.0], frame, frame)
    frame.columns = pd.MultiIndex.from_product([["platform"], ["x", "y", "z"]])
    with pytest.raises(DataError, match="names of two levels"):
        pteron.inverse_kinematics("delta", frame)


def test_a_motion_is_made_of_a_table():
    t = np.linspace(0.0, 1.0, 101)
    wave = {"y": 0.0 * t, "x": 0.1 * np.sin(t), "z": 0.05 * t**3, "t": t}
    expected = pteron.motion.replay("tripteron", Table("wave", pl.DataFrame(wave)))
    for form in (pd.DataFrame, pl.DataFrame, dict):
        motion = pteron.motion.replay("tripteron", form(wave))
        assert (motion.velocity == expected.velocity).all()


HOLE = pl.DataFrame({"x": [0.0, None], "y": [0.0, 0.0], "z": [-0.8, -0.8]})


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (pd.DataFrame({"x": [0.0], "phi": [0.0]}), "pose: no column y, z in a table of x, phi; "),
        ({"x": 0.0, "y": 0.0, "z": "far"}, "pose, column z: not real numbers"),
        (pl.DataFrame({"x": ["0"], "y": [0.0], "z": [0.0]}), "pose, column x: not real numbers"),
        (
            {"x": [0.0, 1.0], "y": [0.0] * 3, "z": 0.0},
            r"pose: columns of different lengths: x \(2,",
        ),
        (HOLE, r"pose\[1, 0\]: nan given, a finite number expected"),
        (Table("a.csv", HOLE), "a.csv: row 2"),
        (
            pd.DataFrame(np.zeros((2, 4)), columns=["x", "x", "y", "z"]),
            "pose, column x: stands twice",
        ),
        ({"x": -1e6, "y": 0.0, "z": 0.0}, "pose: leg 1 misses it by"),
    ],
)
def test_what_a_table_lacks_is_told_in_a_line(table, message):
    with pytest.raises((DataError, pteron.UnreachablePose), match=f"^{message}") as caught:
        pteron.inverse_kinematics("delta", table)
    assert "\n" not in str(caught.value)


def test_a_motion_needs_a_time():
    for table, message in (
        ({"x": [0.0]}, "table: no column t, the time in s; its columns are x"),
        (pl.DataFrame({"t": []}), "table: no rows; its columns are t"),
        (3.0, "table: 3.0 given, a text, a path, a Table, a data frame or a mapping expected"),
    ):
        with pytest.raises(DataError, match=f"^{message}$"):
            pteron.motion.replay("tripteron", table)


# A log of a program's own tables.

LOG_COLUMNS = ("t", "x", "y", "z", "rho1", "rho2", "rho3", "force1", "force2", "force3", "payload")


@pytest.fixture(scope="module")
def recorded():
    """Return a simulated motion of the Tripteron."""
    robot = pteron.load("tripteron")
    start = np.array([0.0, 0.0, 0.0]), np.array([0.1, -0.2, 0.3])
    return robot, pteron.motion.simulate(robot, start=start, duration=0.05)


@pytest.mark.parametrize("form", [dict, pd.DataFrame, pl.DataFrame])
def test_a_log_is_made_of_one_table_or_of_arrays(recorded, form):
    robot, run = recorded
    payload = np.zeros(len(run.time), dtype=int)
    columns = [run.time, *run.pose.T, *run.joints.T, *run.forces.T, payload]
    table = dict(zip(LOG_COLUMNS, columns, strict=True))
    shuffled = form({name: table[name] for name in reversed(LOG_COLUMNS)})
    of = pteron.identification.Log.of
    from_arrays = of(robot, run.time, run.joints, run.forces, pose=run.pose, payload=payload)
    for log in (of(robot, shuffled), of(robot, run.time, shuffled, shuffled, pose=shuffled)):
        for name in ("time", "joints", "forces", "pose"):
            assert np.array_equal(getattr(log, name), getattr(from_arrays, name))
        assert log.joint_names == ("rho1", "rho2", "rho3")
        assert log.force_names == ("force1", "force2", "force3")
    assert np.array_equal(of(robot, shuffled).payload, payload)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (lambda t: (t,), "mine: time alone given; give joints and forces too, or one table"),
        (lambda t: (t, np.zeros((9, 3))), "mine: forces: missing"),
        (lambda t: (t, np.zeros((9, 2)), np.zeros((9, 3))), r"mine: joints: shape \(9, 2\) given"),
        (lambda t: (t, np.zeros((8, 3)), np.zeros((8, 3))), r"mine: joints of shape \(8, 3\)"),
        (lambda t: ({"t": t, "rho1": t},), "mine: joints: no column rho2, rho3 in a table of t"),
        (lambda t: ({"rho1": t, "rho2": t, "rho3": t},), "mine: no column t in a table"),
        (lambda t: ({"t": t[::-1]} | dict.fromkeys(LOG_COLUMNS[4:], t),), "does not rise"),
    ],
)
def test_what_a_log_lacks_is_named(arguments, words):
    with pytest.raises(DataError, match=words):
        pteron.identification.Log.of("tripteron", *arguments(np.arange(9.0)), source="mine")
