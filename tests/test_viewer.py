"""The viewer: what it makes of every action, and its page in a real browser."""

import re
import socket
import subprocess
import sys
from contextlib import closing, contextmanager, suppress
from dataclasses import replace
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from urllib.parse import urlsplit

import numpy as np
import polars as pl
import pytest
from matplotlib.path import Path
from measured import built
from mechanisms import CATALOG, CLIENTS, MECHANISMS, gated
from viewer_pages import opened, slide, unfold, wait_for
from websockets.http11 import Request

import pteron
from pteron.errors import DataError
from pteron.kinematics import inverse_kinematics
from pteron.kinematics.jacobian_at import jacobian_at
from pteron.legs import Reading
from pteron.motion import simulate
from pteron.report.quantities import readable
from pteron.report.typeset import format_fixed
from pteron.viewer import view
from pteron.viewer.boundary import is_allowed
from pteron.viewer.guard import is_local_address
from pteron.viewer.motion_files import motion_of_file
from pteron.viewer.panel import action, activity_text, values
from pteron.viewer.picture import ViewerPicture
from pteron.viewer.pushing import DRIVES
from pteron.viewer.readings import readings
from pteron.viewer.readout import readout
from pteron.viewer.server import free_port
from pteron.viewer.session import Session
from pteron.viewer.slices import choices, slice_map, slice_parts
from pteron.viewer.sliding import nearest_reachable_pose
from pteron.viewer.state import (
    assembly_poses,
    current_assembly,
    load_payload,
    move_joint,
    move_platform,
    state_at_rest,
    switch_assembly,
    switch_working_mode,
    typed_pose,
)


@pytest.fixture(scope="module")
def viewer():
    with view(pteron.load("quadrupteron"), port=0) as found:
        yield found
        assert found.faults == ()


@pytest.fixture(scope="module")
def tab(browser, viewer):
    """A tab with the page, for all tests."""
    with opened(browser, viewer.url) as found:
        unfold(found, "player", "pushed", "plots", "looks")
        yield found


QUICK = ["quadrupteron", "delta", "five-bar", "3-rrr"]


@pytest.fixture(scope="module")
def homes():
    """At rest at home, by name."""
    return {name: state_at_rest(pteron.load(name)) for name in QUICK}


@pytest.mark.parametrize("name", QUICK)
def test_a_pose_out_of_reach_slides_along_the_boundary_and_names_what_stops_it(homes, name):
    home = homes[name]
    robot = home.robot
    rng = np.random.default_rng(0)
    lengths = slice(len(robot.platform.lengths))
    for way in rng.normal(size=(4, robot.freedom)):
        way[lengths.stop :] = 0.0
        target = home.pose + 1.5 * way / np.linalg.norm(way)
        found = move_platform(home, target)
        assert is_allowed(robot, found.pose)
        assert re.match(r"(?:Leg|The \w+ of leg) \d (?:reaches|is at its limit)", found.message)
        rest = float(np.linalg.norm((target - found.pose)[lengths]))
        assert f"is {format_fixed(1e3 * rest)} mm" in found.message
        # Nothing allowed beside it is nearer, but for what is kept to a leg's end and rounding.
        beside = found.pose + 0.01 * rng.normal(size=(300, robot.freedom)) * (way != 0.0)
        beside = beside[is_allowed(robot, beside)]
        assert (np.linalg.norm((target - beside)[:, lengths], axis=-1) > rest - 1e-3).all()
        # From there it goes on along the boundary, and inwards.
        sideways = nearest_reachable_pose(
            robot, found.pose, found.pose + 0.05 * rng.normal(size=robot.freedom)
        )[0]
        assert not np.array_equal(sideways, found.pose)
        inwards = move_platform(found, home.pose)
        assert np.array_equal(inwards.pose, home.pose)


def test_a_pose_in_reach_is_come_to_and_the_next_action_clears_the_message(homes):
    home = homes["quadrupteron"]
    far = move_platform(home, np.array([9.0, 0.0, 0.0, 0.0]))
    assert far.message
    near = move_platform(far, np.array([0.01, 0.02, 0.0, 0.1]))
    assert not near.message
    assert near.pose.tolist() == [0.01, 0.02, 0.0, 0.1]


@pytest.mark.parametrize("name", QUICK)
def test_a_joint_moves_the_platform_in_its_assembly_mode(homes, name):
    home = homes[name]
    for i in range(home.robot.freedom):
        found = move_joint(home, i, home.joints[i] + 0.02)
        assert not found.message
        wanted = home.joints
        wanted[i] += 0.02
        assert np.allclose(found.joints, wanted, atol=1e-9)
        stopped = move_joint(home, i, home.joints[i] + 3.0)
        assert f"of leg {i + 1} stops there" in stopped.message
        assert is_allowed(home.robot, stopped.pose)


def test_assembly_modes_are_those_of_direct_kinematics(homes):
    state = move_platform(homes["3-rrr"], homes["3-rrr"].pose + np.array([0.01, 0.0, 0.1]))
    poses = assembly_poses(state)
    all_of_them = pteron.direct_kinematics(state.robot, state.joints)
    assert np.array_equal(poses, all_of_them[~np.isnan(all_of_them).any(axis=-1)])
    now = current_assembly(state, poses)
    assert np.allclose(poses[now], state.pose, atol=1e-9)
    other = poses[1 - now]
    there = switch_assembly(state, other)
    if is_allowed(state.robot, other):
        assert np.array_equal(there.pose, other)
    else:
        assert "not possible" in there.message
        assert there.pose is state.pose


def test_a_working_mode_keeps_the_pose_or_goes_home(homes):
    home = homes["quadrupteron"]
    kept = switch_working_mode(home, [-1, 1, 1, 1])
    assert np.array_equal(kept.pose, home.pose)
    assert not kept.message
    assert [leg.elbow for leg in kept.robot.legs] == [-1, 1, 1, 1]
    delta = switch_working_mode(homes["delta"], [-1, -1, -1])
    assert "its home" in delta.message
    assert is_allowed(delta.robot, delta.pose)


@pytest.mark.parametrize("text", ["-0.5", "half", "0,5", "", "nan", "1e999", "5 kg"])
def test_a_payload_that_cannot_be_changes_nothing(homes, text):
    carries = load_payload(homes["delta"], "0.25")
    found = load_payload(carries, text)
    assert found.payload == 0.25
    assert found.message.startswith("payload: ")
    assert found.message.endswith("The payload stays 0.25 kg.")
    assert "decimal sign as a point" in found.message or "," not in text


def test_a_payload_likely_in_grams_is_doubted_as_long_as_it_is_carried():
    with pytest.warns(pteron.UnlikelyValue, match="in grams"):
        session = Session(pteron.load("quadrupteron"), 300.0)
    session.set_payload("300")  # a page's: it says so itself
    doubt = "A payload of 300 kg, and the machine moves 5.95 kg of its own: is it in grams?"
    session.load_standard()
    session.advance(0.05)  # the motion's state has no message
    shown = values(session, session.state.joints)
    assert (shown["payload"], shown["payloadDoubt"]) == ("300", doubt)
    session.set_payload("0.3")
    assert values(session, session.state.joints)["payloadDoubt"] == ""


def test_a_pose_that_looks_like_metres_gets_a_hint():
    session = Session(pteron.load("quadrupteron"))
    session.type_pose("0.05, 0.02, -0.04, 0")
    hint = "Lengths are typed in mm: is 0.05 0.02 -0.04 in m? That is 50 20 -40 here."
    assert session.state.message == hint
    assert np.allclose(session.state.pose, [5e-5, 2e-5, -4e-5, 0.0])
    for text in ("50 20 -40 0", "0 0 0 10", "2.5 0 0 0"):  # the last would be out of reach
        session.type_pose(text)
        assert session.state.message == ""


def test_a_typed_pose_is_in_mm_and_degrees(homes):
    robot = homes["quadrupteron"].robot
    for text in ("10,-20,30.5,90", "10, -20, 30.5, 90", "10; -20; 30,5; 90", "10,0 -20 30,5 90,0"):
        assert np.allclose(typed_pose(robot, text), [0.01, -0.02, 0.0305, np.pi / 2])
    # As in a field of one number, a comma is the decimal sign.
    assert np.allclose(typed_pose(robot, "1,000 2 3 4")[:3], [0.001, 0.002, 0.003])
    with pytest.raises(pteron.DataError, match="5 numbers given, 4 expected"):
        typed_pose(robot, "1,5,2,3,4")
    assert np.allclose(typed_pose(robot, "10 -20 30.5 90"), [0.01, -0.02, 0.0305, np.pi / 2])
    for text, told in (("1 2", "4 expected: x y z phi"), ("1 2 x 4", "z: 'x' given")):
        with pytest.raises(pteron.DataError, match=told):
            typed_pose(robot, text)


@pytest.mark.parametrize("name", QUICK)
def test_the_numbers_are_the_librarys(homes, name):
    robot = homes[name].robot
    state = load_payload(homes[name], "0.3")
    rng = np.random.default_rng(1)
    velocity, acceleration = rng.normal(size=(2, robot.freedom))
    state = replace(state, velocity=velocity, acceleration=acceleration)
    found = readings(state)
    loaded = pteron.motion.with_payload(robot, 0.3)
    forces = pteron.drive_forces(loaded, state.pose, velocity, acceleration)
    assert np.array_equal(found.forces, forces)
    assert found.condition == jacobian_at(robot, state.pose).condition
    at = pteron.workspace.pose_margins(robot, state.pose)
    assert np.array_equal(found.type_i, at.type_i)
    assert found.type_ii == at.type_ii
    page = readout(state, found)
    for leg, force, joint in zip(robot.legs, forces, found.joints, strict=True):
        assert f"<td>{format_fixed(force, 2)} {leg.joint.force_unit}</td>" in page
        assert f"<td>{readable(joint, leg.joint.unit)}</td>" in page


def test_a_torques_arrow_goes_round_its_axis_from_the_crank_on(homes):
    state = homes["3-rrr"]
    picture = ViewerPicture(state.robot, state.pose[None], None)
    forces = np.array([1.0, -0.5, 0.25])
    moment = picture.moment(state, forces, np.full(3, 0.5), screws=False)
    for i, (points, leg, _) in enumerate(moment["forces"]):
        assert leg == i
        foot, crank = (np.array(moment["now"]["chains"][i][k]) for k in (0, 1))
        x, y, z = (np.array(points) - foot).T
        angles = np.unwrap(np.arctan2(y, x))
        turned = min(2.0 * abs(forces[i]), 1.75) * np.pi * np.sign(forces[i])
        assert angles[-1] - angles[0] == pytest.approx(turned, abs=1e-3)
        assert np.ptp(z) < 1e-6
        to_crank = crank - foot
        assert angles[0] == pytest.approx(np.arctan2(to_crank[1], to_crank[0]), abs=1e-3)
    assert picture.legend(np.full(3, 18.04)).endswith("half a turn stands for 18.0 N m")


def test_rams_have_a_place_in_their_stroke_and_no_type_i_singularity():
    rams, cranks = (state_at_rest(pteron.load(name)) for name in ("3-rpr", "five-bar"))
    text = readout(rams, readings(rams))
    (low, high), length = rams.robot.legs[0].limits, rams.joints[0]
    assert f"left:{100.0 * (length - low) / (high - low):.1f}%" in text
    assert "type-I singularity" not in text
    assert "to a type-II singularity" in text
    assert 'class="stroke"' not in readout(cranks, readings(cranks))
    assert "to a type-I singularity" in readout(cranks, readings(cranks))


def test_where_the_forces_are_not_determined_the_page_says_why():
    robot = pteron.load("quadrupteron")
    state = state_at_rest(robot, np.array([0.0, 0.0, 0.0, np.pi / 2.0]))
    found = readings(state)
    assert np.isnan(found.forces).all()
    page = readout(state, found)
    assert "No forces here: pose: singular (type II" in page
    assert '<span class="close">very near</span>' in page


@CLIENTS
@pytest.mark.parametrize("name", gated(MECHANISMS, ["delta", "tripteron-oblique"]))
def test_every_machine_is_pushed_by_a_spring_and_stays_where_it_may_be(name):
    robot = MECHANISMS[name]
    session = Session(robot)
    session.begin_push("off: no force")
    push = session.push
    place, _ = robot.platform.placement(session.home)
    rng = np.random.default_rng(0)
    for _ in range(3):
        push.pull(push.spring[0] if push.spring else place, place + rng.normal(size=3))
        for _ in range(4):
            session.advance(1.0 / 30.0)
            assert is_allowed(robot, session.state.pose)
    assert not np.allclose(session.state.pose, session.home, atol=1e-4)
    session.end_push()
    assert not session.state.velocity.any()


def test_a_damped_spring_only_takes_energy_and_the_free_machine_falls_as_simulated(homes):
    robot, home = homes["five-bar"].robot, homes["five-bar"].pose
    push = Session(robot).prepare_push("off: no force")
    free = simulate(robot, start=(home, np.zeros(2)), duration=0.048)
    push.go(0.048)
    np.testing.assert_allclose(push.pose, free.pose[-1], atol=1e-9)
    place, _ = robot.platform.placement(push.pose)
    push.pull(place, place + np.array([0.03, 0.02, 0.0]))

    def energy():
        stretch = np.subtract(*push.spring)
        own = pteron.kinetic_energy(robot, push.pose, push.velocity)
        stored = 0.5 * push.stiffness * stretch @ stretch
        return float(own + pteron.potential_energy(robot, push.pose) + stored)

    found = [energy()]
    for _ in range(60):
        push.go(4e-3)
        found.append(energy())
    assert (np.diff(found) < 1e-3 * np.ptp(found)).all()
    assert np.ptp(found) > 0.0


@CLIENTS
def test_a_spring_lifts_a_small_machine_that_has_fallen():
    session = Session(pteron.load("ball-table"))
    session.begin_push("off: no force")
    for _ in range(20):
        session.advance(1.0 / 30.0)
    assert activity_text(session) == "Drives off: it falls. Pull at its platform."
    fallen = session.state.pose[0]
    assert fallen < session.home[0] - 0.02
    place, _ = session.state.robot.platform.placement(session.state.pose)
    session.push.pull(place, place + np.array([0.0, 0.0, 0.1]))
    for _ in range(20):
        session.advance(1.0 / 30.0)
    assert session.state.pose[0] > fallen + 0.02


def test_drives_hold_what_is_left_to_itself_unless_they_are_off():
    session = Session(pteron.load("five-bar"))
    session.begin_push(next(iter(DRIVES)))
    for _ in range(10):
        session.advance(1.0 / 30.0)
    assert activity_text(session) == "The drives hold its pose. Pull at its platform."
    np.testing.assert_allclose(session.state.pose, session.home, atol=1e-6)


@pytest.fixture(scope="module")
def sessions(homes):
    """Sessions by name, to be left as they are found."""
    return {name: Session(homes[name].robot) for name in ("delta", "five-bar")}


@pytest.mark.parametrize(("name", "plane"), [("quadrupteron", "xz"), ("3-rrr", "xy")])
def test_a_slice_goes_round_what_serves_and_what_only_a_limit_forbids(homes, name, plane):
    robot, home = homes[name].robot, homes[name].pose
    i, j = ("xyz".index(letter) for letter in plane)
    (_, serves), (_, limited) = slice_parts(robot, home, plane, Session(robot).pose_range)
    poses = np.tile(home, (4000, 1))
    poses[:, [i, j]] += np.random.default_rng(0).uniform(-0.3, 0.3, (4000, 2))

    def within(rings):
        paths = [Path(ring[:, [i, j]]) for ring in rings]
        return sum((path.contains_points(poses[:, [i, j]]) for path in paths), np.zeros(4000)) % 2

    reached = np.isfinite(inverse_kinematics(robot, poses, on_failure="nan")).all(axis=-1)
    served = reached & is_allowed(robot, poses)
    assert served.mean() > 0.05
    assert (within(serves) == served).mean() > 0.997
    assert (within(limited) == (reached & ~served)).mean() > 0.997


def test_a_machine_has_a_slice_by_any_two_lengths(homes):
    assert list(choices(homes["quadrupteron"].robot)) == ["none", "xy", "xz", "yz"]


@CLIENTS
def test_a_slice_along_an_angle_is_a_map():
    robot = pteron.load("ball-table")
    planes = choices(robot)
    assert list(planes) == ["none", "z, roll", "z, pitch", "roll, pitch"]
    span = np.array([[0.0, -0.5, -0.5], [0.3, 0.5, 0.5]])
    home = pteron.workspace.home_pose(robot)
    drawn = slice_map(robot, home, planes["z, roll"], span)
    assert "Reach over z and roll" in drawn
    assert "(mm)" in drawn
    assert "(°)" in drawn
    assert drawn != slice_map(robot, home + np.eye(3)[1] / 10, planes["z, roll"], span)


def _csv(frame):
    return frame.write_csv().encode()


def _wave(robot, home, rows=301):
    t = np.linspace(0.0, 1.5, rows)
    pose = home + 0.02 * np.outer(np.sin(2 * np.pi * t) ** 3, np.ones(robot.freedom))
    return t, pose


def test_motions_joints_and_logs_are_read(homes):
    robot, home = homes["delta"].robot, homes["delta"].pose
    t, pose = _wave(robot, home)
    poses = pl.DataFrame({"t": t} | dict(zip(robot.coordinates, pose.T, strict=True)))
    motion = motion_of_file(robot, "a.csv", _csv(poses), home)
    assert np.allclose(motion.at(0.4)[0], home + 0.02 * np.sin(0.8 * np.pi) ** 3, atol=1e-6)
    written = poses.write_csv(separator=";", decimal_comma=True).encode()
    np.testing.assert_array_equal(motion_of_file(robot, "d.csv", written, home).pose, motion.pose)
    joints = pteron.inverse_kinematics(robot, pose)
    columns = dict(zip(robot.joint_names, joints.T, strict=True))
    followed = motion_of_file(robot, "b.csv", _csv(pl.DataFrame({"t": t} | columns)), home)
    assert np.allclose(followed.pose, pose, atol=1e-9)
    forces = {name: np.sin(9 * t) for name in robot.force_names}
    degrees = {f"{name} [deg]": np.degrees(values) for name, values in columns.items()}
    log = pl.DataFrame({"time [ms]": 1e3 * t} | degrees | forces)
    text = log.write_csv(separator=";", decimal_comma=True).encode()
    logged = motion_of_file(robot, "log.csv", text, home)
    inside = slice(40, -40)
    assert np.allclose(logged.at(t)[0][inside], pose[inside], atol=1e-4)


@pytest.mark.parametrize(
    ("name", "data", "told"),
    [
        ("log.txt", b"t,x\n", "log.txt: a motion's file ends in .csv or .parquet"),
        ("log.csv", b"", "log.csv: is empty"),
        ("log.csv", b"t,x,y,z\n0,0,0,-0.9\n0.1,a,0,-0.9\n", "log.csv: row 2"),
        ("log.csv", b"t,x,y,z\n0,0,0,-900\n1,1,0,-900\n2,2,0,-900\n", "reach"),
        ("log.csv", b"\x00\xff\x00", "log.csv"),
        ("log.csv", b"a,b\n1,2\n", "log.csv"),
        ("log.parquet", b"PAR1", "log.parquet: not a Parquet file"),
    ],
)
def test_a_malformed_log_is_told_by_its_name(homes, name, data, told):
    home = homes["delta"]
    with pytest.raises(pteron.PteronError, match=re.escape(told)):
        motion_of_file(home.robot, name, data, home.pose)


def test_a_motion_plays_in_its_own_time(sessions):
    session = sessions["five-bar"]
    session.load_standard()
    assert session.playing
    session.speed = 0.5
    session.advance(0.1)
    assert session.time == pytest.approx(0.05, rel=1e-12)
    pose, velocity, acceleration = session.motion.at(0.05)
    assert np.array_equal(session.state.pose, pose)
    assert np.array_equal(session.state.velocity, velocity)
    assert np.array_equal(session.state.acceleration, acceleration)
    session.advance(2.0 * session.motion.duration)
    assert session.time == pytest.approx(0.05, abs=1e-9)
    session.set_coordinate(0, 0.0)
    assert not session.playing
    assert not session.state.velocity.any()


@CLIENTS
def test_what_was_done_is_undone_and_spans_end_where_the_machine_stops(homes):
    session = Session(homes["3-rrr"].robot)
    session.remember()
    session.set_coordinate(1, 0.02)
    session.remember()
    session.set_working_mode([-1, 1, 1])
    assert session.state.robot.legs[0].elbow == -1
    session.undo()
    assert session.state.robot == homes["3-rrr"].robot
    assert session.state.pose[1] == pytest.approx(0.02)
    session.undo()
    assert np.array_equal(session.state.pose, session.home)
    session.undo()
    assert session.state.message == "There is nothing to undo."
    assert session.joint_spans(lambda: True) is None
    poses, joints = session.pose_spans(), session.joint_spans()
    for i, (low, high) in enumerate(poses.T):
        ends = np.tile(session.home, (2, 1))
        ends[:, i] = low, high
        assert is_allowed(session.state.robot, ends).all()
        assert low < session.home[i] < high
    assert (joints[0] < session.state.joints).all()


@pytest.mark.parametrize(
    "asked",
    [
        *("", "[]", "7", '{"do": "no such"}', '{"do": "seek"}'),
        '{"do": "coordinate", "i": 9, "value": 0}',
        '{"do": "coordinate", "i": 0, "value": "much"}',
        '{"do": "joint", "i": -1, "value": 0}',
        '{"do": "drag", "axis": 5, "to": [0, 0, 0]}',
        '{"do": "drag", "axis": null, "to": [0, NaN]}',
        '{"do": "mode", "mode": "?"}',
        '{"do": "plane", "plane": "uv"}',
        '{"do": "assembly", "i": -Infinity}',
        "[" * 100_000,
    ],
)
def test_what_no_page_asks_for_is_refused(sessions, asked):
    with pytest.raises(DataError, match="load it again"):
        action(sessions["delta"], asked)


def test_a_drag_moves_or_turns_the_platform(homes):
    session = Session(homes["quadrupteron"].robot)
    session.drag(None, np.array([0.01, 0.02, 0.03]))
    assert np.allclose(session.state.pose, [0.01, 0.02, 0.03, session.home[3]])
    session.drag(0, np.array([0.01 + np.cos(0.3), 0.02 + np.sin(0.3), 0.03]))
    assert session.state.pose[3] == pytest.approx(0.3, abs=1e-12)
    tilting = Session(pteron.load("ankle"))
    axes = tilting.state.robot.platform.placement(tilting.home)[1]
    place = tilting.state.robot.platform.placement(tilting.home)[0]
    tilting.drag(2, place + axes[2] + 0.1 * axes[0])
    turned = tilting.state.robot.platform.placement(tilting.state.pose)[1]
    assert turned[2] @ axes[0] == pytest.approx(np.sin(np.arctan(0.1)), abs=1e-9)


def test_a_motion_of_another_mode_is_dropped_with_it(sessions):
    session = sessions["delta"]
    session.load_standard()
    assert session.set_working_mode([-1, -1, -1])
    assert session.motion is None
    assert "load it again" in session.state.message


def test_hosts_and_ports_are_checked():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert free_port("127.0.0.1", port) > port
    with socket.socket() as last:
        with suppress(OSError):  # then another program has it
            last.bind(("127.0.0.1", 65535))
            last.listen()
        with pytest.raises(pteron.DataError, match="port: 65535 is taken; give"):
            free_port("127.0.0.1", 65535)
    for host, port, told in (
        ("no such host", 8080, "is no address"),
        ("203.0.113.7", 8080, "no address of this machine"),
        ("127.0.0.1", 70000, "whole number from 0 to 65535"),
    ):
        with pytest.raises(pteron.DataError, match=told):
            free_port(host, port)


@pytest.fixture(scope="module")
def local():
    with view(pteron.load("five-bar"), port=0) as found:
        yield found


def answer(viewer, host, origin=None, upgrade=True):
    """The status of the answer to a request with such headers."""
    headers = {"Host": host} if origin is None else {"Host": host, "Origin": origin}
    if upgrade:
        headers |= {
            "Upgrade": "websocket",
            "Connection": "Upgrade",
            "Sec-WebSocket-Version": "13",
            "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
        }
    address = urlsplit(viewer.url)
    connection = HTTPConnection(address.hostname, address.port, timeout=20)
    with closing(connection):
        connection.request("GET", "/", headers=headers)
        return connection.getresponse().status


@pytest.mark.parametrize("upgrade", [False, True])
def test_names_of_other_machines_and_pages_of_other_servers_are_refused(local, upgrade):
    port = local.port
    good = 101 if upgrade else 200
    for name in ("127.0.0.1", "localhost", "LOCALHOST", "[::1]", "127.0.0.9"):
        here = f"{name}:{port}"
        assert answer(local, here, upgrade=upgrade) == good
        assert answer(local, here, f"http://{here}", upgrade) == good
    # What forwards a port gives both another.
    assert answer(local, "localhost:9000", "http://localhost:9000", upgrade) == good
    for name in ("evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "evil"):
        host = f"{name}:{port}"
        assert answer(local, host, upgrade=upgrade) == 403
        assert answer(local, host, f"http://{host}", upgrade) == 403
    for origin in ("http://evil.example", f"http://localhost:{port + 1}", "null", "file://", ""):
        assert answer(local, f"localhost:{port}", origin, upgrade) == 403


def test_other_requests_than_for_a_page_are_refused_and_no_page_frames_it(local):
    with closing(HTTPConnection("127.0.0.1", local.port, timeout=20)) as connection:
        connection.request("GET", "/")
        response = connection.getresponse()
        policy = response.getheader("Content-Security-Policy")
        assert policy.startswith("frame-ancestors 'self' http://localhost:*")
        assert "evil" not in policy
        assert " * " not in f" {policy} "
    if not hasattr(Request, "method"):
        return  # what websockets answered before it told the method is its own
    for method in ("POST", "TRACE", "DELETE", "HEAD"):
        with closing(HTTPConnection("127.0.0.1", local.port, timeout=20)) as connection:
            connection.request(method, "/")
            assert connection.getresponse().status == 405


def test_who_serves_to_the_network_has_names_unknown_here_but_no_foreign_pages():
    with view(pteron.load("five-bar"), port=0, host="0.0.0.0") as wide:
        host = f"lab.example:{wide.port}"
        assert answer(wide, host) == 101
        assert answer(wide, host, f"http://{host}") == 101
        assert answer(wide, host, "http://evil.example") == 403


@pytest.mark.parametrize(
    ("host", "here"),
    [
        *(("127.0.0.1", True), ("localhost", True), ("::1", True), ("127.1.2.3", True)),
        *(("0.0.0.0", False), ("::", False), ("", False), ("::1234", False)),
        *(("192.0.2.1", False), ("127.evil.invalid", False)),
    ],
)
def test_hosts_that_only_this_machine_reaches(host, here):
    assert is_local_address(host) == here


# In a real browser.


SHOWN = """values => {
    const sliders = [...document.querySelectorAll('#panel input[type=range]')];
    return values.every((value, i) => Math.abs(Number(sliders[i].value) - value) < 0.051);
}"""
"""Whether the first sliders of a page stand at values."""


def said(tab, text):
    """Wait until the page's status says something."""
    wait_for(tab, "text => document.querySelector('[role=status]').innerText.includes(text)", text)
    return tab.inner_text("[role=status]")


@pytest.fixture
def page(tab, viewer):
    """The page, the machine at home and without a payload."""
    viewer.move_to([0.0, 0.0, 0.0, 0.0])
    assert viewer.wait(10.0)
    wait_for(tab, SHOWN, [0.0] * 8)
    tab.wait_for_timeout(300)
    return tab


@CLIENTS
def test_a_slider_moves_the_robot_and_the_forces_are_the_librarys(page, viewer):
    before = page.locator("#view").screenshot()
    slide(page, "x (mm)", ["PageUp", *["ArrowRight"] * 5])
    wait_for(page, "() => Number(document.getElementById('pose0').value) > 10")
    page.wait_for_timeout(300)
    assert viewer.wait(10.0)
    pose = viewer.state.pose
    assert pose[0] > 0.01
    assert pose[1:].tolist() == [0.0, 0.0, 0.0]
    still = np.zeros(4)
    forces = pteron.drive_forces(viewer.state.robot, pose, still, still)
    wait_for(
        page,
        "wanted => [...document.querySelectorAll('table.legs td:nth-child(3)')]"
        ".every((cell, i) => cell.innerText === wanted[i] + ' N')",
        [format_fixed(force, 2) for force in forces],
    )
    assert page.locator("#view").screenshot() != before
    page.keyboard.press("Tab")
    page.get_by_role("button", name="Undo").click()
    wait_for(page, SHOWN, [0.0] * 4)


@CLIENTS
def test_a_drag_out_of_reach_slides_and_a_slider_at_its_end_blocks_no_other(page, viewer):
    slide(page, "x (mm)", ["End"])
    said(page, "mm from the pose asked for")
    slide(page, "y (mm)", ["PageUp"])
    wait_for(page, "() => Number(document.getElementById('pose1').value) > 5")
    assert viewer.wait(10.0)
    assert is_allowed(viewer.state.robot, viewer.state.pose)
    assert viewer.state.pose[1] > 0.005
    assert viewer.state.pose[0] > 0.05
    page.wait_for_timeout(600)
    ends = page.eval_on_selector("#pose0", "one => one.style.getPropertyValue('--to')")
    assert 50.0 < float(ends.rstrip("%")) <= 100.0


WATCH = """() => {
    const button = document.getElementById('push');
    window.seen = [];
    new MutationObserver(() => {
        if (seen.at(-1) !== button.textContent) seen.push(button.textContent);
    }).observe(button, { childList: true });
}"""
"""Keeps in `seen` what is written on the button of a push."""


@CLIENTS
def test_the_mouse_drags_the_platform_and_pushes_it(page, viewer):
    box = page.locator("#view").bounding_box()

    def drag(by):
        x, y = page.evaluate("() => document.getElementById('view').platform()")
        page.mouse.move(box["x"] + x, box["y"] + y)
        page.mouse.down()
        for k in range(1, 9):
            page.mouse.move(box["x"] + x + by * k / 8, box["y"] + y - by * k / 8)
            page.wait_for_timeout(30)

    drag(40)
    page.mouse.up()
    page.wait_for_timeout(300)
    assert np.linalg.norm(viewer.state.pose[:3]) > 0.02
    assert viewer.state.pose[3] == 0.0
    viewer.move_to([0.0, 0.0, 0.0, 0.0])
    page.evaluate(WATCH)
    page.click("#push")
    wait_for(page, "() => document.getElementById('push').textContent === 'Bring it to rest'")
    assert page.evaluate("seen").count("Preparing …") == 1
    assert page.inner_text("#does") == "The drives hold its pose. Pull at its platform."
    drag(60)
    page.wait_for_timeout(800)
    pulled = viewer.state.pose
    page.mouse.up()
    assert np.linalg.norm(pulled[:3]) > 0.002
    for _ in range(100):  # the drives' springs take it back
        if np.linalg.norm(viewer.state.pose[:3]) < 0.5 * np.linalg.norm(pulled[:3]):
            break
        page.wait_for_timeout(200)
    else:
        pytest.fail("the platform stays away")
    page.click("#push")
    said(page, "at rest")


@CLIENTS
def test_a_reload_a_second_tab_and_a_link_show_the_same(page, viewer, browser):
    slide(page, "z (mm)", ["ArrowRight"] * 7)
    slide(page, "phi (°)", ["ArrowRight"] * 9)
    wait_for(page, SHOWN, [0.0, 0.0, 0.7, 0.9])
    with opened(browser, viewer.url) as other:
        assert "All who open this page move one machine." in other.inner_text("#panel")
        assert other.inner_text("table.legs") == page.inner_text("table.legs")
        slide(other, "x (mm)", ["ArrowLeft"] * 3)
        wait_for(page, SHOWN, [-0.3, 0.0, 0.7, 0.9])
        other.get_by_role("button", name="Copy link").click()
        wait_for(other, "() => location.hash.includes('pose=')")
        link = other.url
    viewer.move_to([0.0, 0.0, 0.0, 0.0])
    with opened(browser, link) as third:
        wait_for(third, SHOWN, [-0.3, 0.0, 0.7, 0.9])
        wait_for(page, SHOWN, [-0.3, 0.0, 0.7, 0.9])


UNDER_THE_BAR = """() => {
    const view = document.getElementById('view'), bar = document.querySelector('.top');
    const tall = Math.floor((bar.offsetHeight * view.height) / view.clientHeight);
    const { data } = view.getContext('2d').getImageData(0, 0, view.width, tall);
    return data.some((value, i) => i % 4 === 3 && value > 0);
}"""
"""Whether something is drawn where the name and the buttons are."""


@CLIENTS
@pytest.mark.parametrize(("width", "height"), [(390, 780), (800, 700), (1440, 900)])
def test_the_machine_is_in_sight_at_any_size(browser, viewer, width, height):
    with opened(browser, viewer.url, width, height) as tab:
        tab.wait_for_timeout(300)
        box = tab.locator("#view").bounding_box()
        assert box["width"] > 0.5 * width
        assert box["height"] > 0.9 * height
        assert tab.locator("#panel").is_visible() == (width > 760)
        assert len(_colors(tab, tab.locator("#view").screenshot())) > 100
        tab.get_by_role("button", name="Controls").click()
        tab.wait_for_timeout(300)
        assert not tab.evaluate(UNDER_THE_BAR)
        other = tab.locator("#view").bounding_box()
        if width < 760:  # the panel takes a part of the window, and the machine the rest
            assert other["height"] > 0.4 * height
            assert tab.locator("#panel").bounding_box()["y"] >= other["height"] - 1
        wide = tab.evaluate("document.documentElement.scrollWidth")
        assert wide <= width


@CLIENTS
def test_a_motion_has_its_controls_below_the_picture_and_the_ranges_follow_it(browser):
    with view("five-bar", port=0, motion="adept") as viewer, opened(browser, viewer.url) as tab:
        pause = tab.get_by_role("button", name="Pause")
        pause.wait_for()
        picture, bar = (tab.locator(name).bounding_box() for name in ("#view", "#transport"))
        assert bar["y"] + bar["height"] <= picture["y"] + picture["height"] <= 900
        for name in ("pose0", "joint0"):
            band = f"document.getElementById('{name}').style.getPropertyValue('--from')"
            first = tab.evaluate(band)
            wait_for(tab, f"first => {band} !== '' && {band} !== first", first)
        pause.click()
        assert viewer.wait(10.0)
        assert viewer.faults == ()
    with view("five-bar", port=0) as viewer, opened(browser, viewer.url) as tab:
        assert not tab.locator("#transport").is_visible()


@CLIENTS
def test_a_hint_at_the_ring_is_there_until_it_was_dragged_once(browser, viewer):
    viewer.move_to([0.0, 0.0, 0.0, 0.0])
    assert viewer.wait(10.0)
    with opened(browser, viewer.url, 390, 844) as tab:
        tab.locator("#first").wait_for()
        box = tab.locator("#view").bounding_box()
        x, y = tab.evaluate("() => document.getElementById('view').platform()")
        hint = tab.locator("#first").bounding_box()
        assert abs(hint["y"] - y) < 30
        assert 0 <= hint["x"] < hint["x"] + hint["width"] <= 390
        tab.mouse.move(box["x"] + x, box["y"] + y)
        tab.mouse.down()
        tab.mouse.move(box["x"] + x + 5, box["y"] + y)
        tab.mouse.up()
        assert not tab.locator("#first").is_visible()
        tab.reload()
        tab.locator("table.legs").wait_for(state="attached")
        tab.wait_for_timeout(300)
        assert not tab.locator("#first").is_visible()


@CLIENTS
def test_while_the_panel_is_folded_the_drives_forces_stand_over_the_picture(browser, viewer):
    viewer.move_to([0.0, 0.0, 0.0, 0.0])
    assert viewer.wait(10.0)
    forces = pteron.drive_forces(viewer.state.robot, np.zeros(4), np.zeros(4), np.zeros(4))
    shown = " ".join(
        f"{i} {format_fixed(force, 1 if abs(force) < 100.0 else 0)} N"
        for i, force in enumerate(forces, start=1)
    )
    with opened(browser, viewer.url, 390, 844) as tab:
        tab.locator("#given .leg4").wait_for()
        assert " ".join(tab.inner_text("#given").split()) == shown


@CLIENTS
def test_while_the_panel_is_folded_pose_and_limit_stand_over_the_picture(browser, viewer):
    with opened(browser, viewer.url, 390, 844) as tab:
        for x in (0.0, 1.0):
            viewer.move_to([x, 0.0, 0.0, 0.0])
            assert viewer.wait(10.0)
        said(tab, "mm from the pose asked for")
        x = format_fixed(1e3 * viewer.state.pose[0])
        assert tab.inner_text("#where") == f"x {x} y 0.0 z 0.0 mm, phi 0.0°"
        status = tab.get_by_role("status")
        assert status.is_visible()
        above = tab.locator(".tools").bounding_box()
        assert status.bounding_box()["y"] >= above["y"] + above["height"]
        assert tab.evaluate("document.documentElement.scrollWidth") <= 390
        tab.get_by_role("button", name="Controls").click()
        assert not tab.locator("#where").is_visible()
        assert tab.locator("#panel").get_by_role("status").is_visible()


def _colors(tab, png):
    """Return the colours in a picture, as the browser itself decodes it."""
    from base64 import b64encode

    return tab.evaluate(
        """async data => {
            const image = new Image();
            image.src = 'data:image/png;base64,' + data;
            await image.decode();
            const canvas = document.createElement('canvas');
            canvas.width = image.width; canvas.height = image.height;
            const draw = canvas.getContext('2d');
            draw.drawImage(image, 0, 0);
            const pixels = draw.getImageData(0, 0, image.width, image.height).data;
            const found = new Set();
            for (let i = 0; i < pixels.length; i += 4)
                found.add(pixels[i] + 256 * (pixels[i + 1] + 256 * pixels[i + 2]));
            return [...found];
        }""",
        b64encode(png).decode(),
    )


@CLIENTS
def test_a_slice_along_angles_is_shown_in_the_panel(browser):
    with view(pteron.load("ankle"), port=0) as viewer, opened(browser, viewer.url) as tab:
        unfold(tab, "looks")
        tab.select_option("#plane", "alpha, beta")
        drawn = tab.locator("svg[aria-label='Reach over alpha and beta']")
        drawn.wait_for()
        box = drawn.bounding_box()
        assert min(box["width"], box["height"]) > 150.0
        before = drawn.inner_html()
        viewer.move_to(viewer.state.pose + 0.1)
        wait_for(tab, "before => document.querySelector('svg.plot').innerHTML !== before", before)
        tab.select_option("#plane", "none")
        drawn.wait_for(state="detached")
        assert viewer.faults == ()


@CLIENTS
def test_what_is_typed_wrongly_is_told_on_the_page(page, viewer):
    def payload(text):
        page.fill("#payload", text)
        page.press("#payload", "Tab")

    payload("0.4")
    wait_for(page, "() => !document.querySelector('[role=status]').innerText.includes('payload')")
    page.wait_for_timeout(200)
    assert viewer.state.payload == 0.4
    for text in ("-1", "half a kilo"):
        payload(text)
        assert "The payload stays 0.4 kg." in said(page, "a mass of 0 kg or more expected")
    payload("300")
    wait_for(page, "() => document.getElementById('payload-doubt').innerText.includes('in grams?')")
    payload("0")
    wait_for(page, "() => document.getElementById('payload-doubt').hidden")
    page.fill("#type", "10 20 thirty 0")
    page.get_by_role("button", name="Go there").click()
    assert "z: 'thirty' given, a number expected" in said(page, "thirty")
    assert viewer.state.pose.tolist() == [0.0, 0.0, 0.0, 0.0]
    page.fill("#type", "10 20 30 0")
    page.get_by_role("button", name="Go there").click()
    said(page, "at rest")
    assert viewer.wait(10.0)
    assert np.allclose(viewer.state.pose, [0.01, 0.02, 0.03, 0.0], atol=1e-12)
    for text, shown in (
        ("12,5", 12.5),
        ("far", 12.5),
    ):  # a decimal comma; no number
        page.fill("#pose0n", text)
        page.press("#pose0n", "Tab")
        wait_for(page, "x => document.getElementById('pose0n').value === String(x)", shown)
        assert viewer.wait(10.0)
        assert np.isclose(viewer.state.pose[0], 0.0125, atol=1e-12)


@CLIENTS
def test_a_malformed_log_is_a_message_and_a_good_one_plays_steps_and_is_scrubbed(page, tmp_path):
    bad, good = tmp_path / "bad.csv", tmp_path / "good.csv"
    bad.write_text("t,x,y,z,phi\n0,0,0,0,0\n0.1,what,0,0,0\n")
    t = np.linspace(0.0, 4.0, 201)
    wave = {"t": t, "x": 0.05 * np.sin(t), "y": 0 * t, "z": 0.1 * np.sin(2 * t), "phi": 0 * t}
    pl.DataFrame(wave).write_csv(good)
    page.set_input_files("#file", bad)
    assert "'what'" in said(page, "bad.csv")
    page.set_input_files("#file", good)
    said(page, "moves")
    page.get_by_text("good.csv: 4 s").wait_for()
    page.get_by_role("button", name="Pause").click()
    said(page, "at a moment of its motion")
    page.fill("#time", "1.5")
    wait_for(page, "() => document.getElementById('clock').textContent.startsWith('1.50')")
    page.get_by_role("button", name="A step on").click()
    wait_for(page, "() => document.getElementById('clock').textContent.startsWith('1.52')")
    wait_for(page, SHOWN, [round(50 * np.sin(1.5 + 1 / 60), 1)])


OPENS = """url => new Promise(done => {
    const socket = new WebSocket(url);
    socket.onmessage = () => done('read');
    socket.onerror = () => done('refused');
})"""


POSES = r"""() => {
    const fields = [0, 1, 2].map(i => Number(document.getElementById(`pose${i}n`).value));
    const words = document.getElementById('assembly').selectedOptions[0].text;
    const listed = words.replace(/^.*: /, '').replaceAll('\u2212', '-').split(' ').map(Number);
    return [fields, listed];
}"""
"""The pose in the fields, and the one in the list of assembly modes."""


@CLIENTS
def test_while_a_cycle_plays_the_assembly_mode_has_the_pose_of_the_fields(browser):
    with view(pteron.load("delta"), motion="adept", port=0) as viewer:
        with opened(browser, viewer.url) as tab:
            seen = set()
            for _ in range(20):
                fields, listed = tab.evaluate(POSES)
                assert listed == pytest.approx(fields, abs=0.11)  # one rounds half up, one to even
                seen.add(tuple(listed))
                tab.wait_for_timeout(60)
            assert len(seen) > 3
            unfold(tab, "player")
            tab.click("#play")
            numbered = "() => document.getElementById('assembly').options[0].text.startsWith('1: ')"
            wait_for(tab, numbered)
            fields, listed = tab.evaluate(POSES)
            assert listed == pytest.approx(fields, abs=0.11)
        assert viewer.faults == ()


@contextmanager
def other_server():
    """A server of somebody else's page on this machine; its port."""

    class Page(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(b"<title>another page</title>")

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Page)
    thread = Thread(target=server.serve_forever)
    thread.start()
    try:
        yield server.server_address[1]
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


@CLIENTS
def test_no_other_page_opens_the_viewers_socket(browser, local):
    with other_server() as port:
        tab = browser.new_page()
        for page in ("127.0.0.1", "localhost", "evil.localhost"):
            tab.goto(f"http://{page}:{port}/")
            for asked in ("127.0.0.1", "evil.localhost"):
                assert tab.evaluate(OPENS, f"ws://{asked}:{local.port}") == "refused"
        # A name that its owner points here: page and socket have the same origin.
        assert tab.goto(f"http://evil.localhost:{local.port}").status == 403
        assert tab.evaluate(OPENS, f"ws://evil.localhost:{local.port}") == "refused"
        tab.goto(local.url)
        assert tab.evaluate(OPENS, f"ws://127.0.0.1:{local.port}") == "read"
        tab.close()


@CLIENTS
def test_the_page_opens_by_the_other_names_of_this_machine_and_in_a_frame(browser, local):
    with view(pteron.load("five-bar"), port=0, host="::1") as viewer, opened(browser, viewer.url):
        assert viewer.url == f"http://[::1]:{viewer.port}"
    # As a notebook shows it, whose page is another server's.
    with other_server() as port:
        tab = browser.new_page()
        tab.goto(f"http://localhost:{port}/")
        tab.set_content(f'<iframe src="http://localhost:{local.port}" width="900"></iframe>')
        tab.frame_locator("iframe").locator("table.legs").wait_for(timeout=60_000)
        tab.close()


@CLIENTS
def test_machines_stand_side_by_side_and_move_apart(browser):
    with view("five-bar", port=0, beside=["delta"]) as viewer:
        tab = browser.new_page()
        tab.goto(viewer.url)
        for name in ("five-bar", "delta"):
            frame = tab.frame_locator(f"iframe[title='{name}']")
            frame.locator("table.legs").wait_for(state="attached", timeout=60_000)
        (other,) = viewer.beside
        home = viewer.state.pose
        other.move_to(other.state.pose + 0.05)
        assert other.wait(10.0)
        assert np.array_equal(viewer.state.pose, home)
        tab.close()
        assert viewer.faults == other.faults == ()


@CLIENTS
def test_a_server_that_is_gone_says_so_and_its_page_comes_back(browser):
    robot = pteron.load("five-bar")
    with view(robot, port=0) as first, opened(browser, first.url) as tab:
        port = first.port
        assert not tab.locator("#gone").is_visible()
        first.close()
        tab.get_by_role("alert").get_by_text("The server is gone").wait_for()
        with view(robot, port=port) as second:
            assert second.port == port
            second.move_to([0.01, 0.12])
            wait_for(tab, SHOWN, [10.0, 120.0])
            assert not tab.locator("#gone").is_visible()
            slide(tab, "x (mm)", ["ArrowRight"] * 5)
            wait_for(tab, SHOWN, [10.5, 120.0])
            assert second.faults == ()
        with view("delta", port=port) as third:
            tab.locator("#pose2").wait_for()
            wait_for(tab, "document.title.includes('delta')", True)
            assert third.faults == ()


@CLIENTS
def test_the_command_prints_where_the_page_is_and_ends_with_ctrl_c(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        words = [sys.executable, "-m", "pteron", "view", "five-bar", "--no-browser"]
        with subprocess.Popen(
            [*words, "--port", str(port)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as process:
            line = process.stdout.readline()
            process.send_signal(2)
            rest, notes = process.communicate(timeout=30)
    assert re.fullmatch(r"five-bar is at http://127\.0\.0\.1:\d+ \(Ctrl-C ends it\)\n", line)
    assert str(port) not in line
    assert f"Note: port {port} is in use" in notes
    assert (rest, process.returncode) == ("", 0)


def test_a_drives_readings_stand_beside_its_joint_coordinates():
    robot = pteron.load("five-bar")
    legs = (robot.legs[0], replace(robot.legs[1], reading=Reading(0.02, 2.0)))
    state = Session(replace(robot, legs=legs)).state
    found = readings(state)
    shown = np.degrees([found.joints[0], (found.joints[1] - 0.02) / 2.0])
    table = readout(state, found).replace("</td><td>", " ")
    for joint, reads in zip(np.degrees(found.joints), shown, strict=True):
        assert f"{format_fixed(joint, 1)}° {format_fixed(reads, 1)}° " in table
    assert "<th>reads</th>" in table


@CLIENTS
def test_a_compared_machine_stands_in_the_picture_and_moves_along(browser):
    robot, pictures = CATALOG["linear-delta"], []
    with pytest.raises(DataError, match="no machine to compare with"):
        view(robot, port=0, compare="delta")
    for compared in (None, built(robot)):
        with view(robot, port=0, compare=compared) as viewer, opened(browser, viewer.url) as tab:
            for step in (0.0, 0.03):
                viewer.move_to(viewer.state.pose + np.array([step, 0.0, 0.0]))
                assert viewer.wait(10.0)
                tab.wait_for_timeout(1000)
                pictures.append(tab.locator("#view").screenshot())
            assert viewer.faults == ()
    assert len(set(pictures)) == 4
