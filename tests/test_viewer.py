"""The viewer: what it makes of every action, and its page in a real browser."""

import re
import socket
import subprocess
import sys
from contextlib import closing, contextmanager, suppress
from dataclasses import replace
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import metadata
from itertools import pairwise
from threading import Thread
from urllib.parse import urlsplit

import numpy as np
import polars as pl
import pytest
from measured import built
from mechanisms import CATALOG, CLIENTS, MECHANISMS, gated

import pteron
from pteron.errors import DataError
from pteron.kinematics.jacobian_at import jacobian_at
from pteron.legs import Reading
from pteron.motion import joint_guides, joint_points
from pteron.plots.canvas import LEG_COLORS
from pteron.report.quantities import readable
from pteron.report.typeset import fixed
from pteron.viewer import view
from pteron.viewer.boundary import allowed
from pteron.viewer.guard import is_here
from pteron.viewer.motion_files import motion_of_file
from pteron.viewer.readings import readings
from pteron.viewer.readout import readout
from pteron.viewer.server import free_port
from pteron.viewer.session import Session
from pteron.viewer.slices import choices, slice_map, slice_meshes
from pteron.viewer.solids import from_z, moving_solids
from pteron.viewer.state import (
    assembled,
    assembly_poses,
    at_rest,
    carrying,
    current_assembly,
    in_working_mode,
    joint_moved,
    moved,
    typed_pose,
)

QUICK = ["quadrupteron", "delta", "five-bar", "3-rrr"]


@pytest.fixture(scope="module")
def homes():
    """At rest at home, by name."""
    return {name: at_rest(pteron.load(name)) for name in QUICK}


@pytest.mark.parametrize("name", QUICK)
def test_a_pose_out_of_reach_ends_at_the_boundary_and_names_the_leg(homes, name):
    home = homes[name]
    robot = home.robot
    rng = np.random.default_rng(0)
    for way in rng.normal(size=(6, robot.freedom)):
        way[len(robot.platform.lengths) :] *= 0.1
        target = home.pose + 3.0 * way / np.linalg.norm(way)
        found = moved(home, target)
        assert allowed(robot, found.pose)
        share = (found.pose - home.pose) @ way / (way @ (target - home.pose))
        assert np.allclose(found.pose, home.pose + share * (target - home.pose), atol=1e-12)
        assert not allowed(robot, found.pose + 1e-6 * (target - home.pose))
        named = re.match(r"(?:Leg|The \w+ of leg) (\d) (?:reaches|is at its limit)", found.message)
        leg = int(named[1]) - 1
        beyond = found.pose + 1e-6 * (target - home.pose)
        alone = pteron.workspace.pose_margins(robot, beyond)
        at_end = alone.type_i[leg] < 0.0101, alone.joints[leg] < 0.0
        assert any(at_end)
        rest = np.linalg.norm((target - found.pose)[: len(robot.platform.lengths)])
        assert f"stops {fixed(1e3 * rest)} mm" in found.message


def test_a_pose_in_reach_is_come_to_and_the_next_action_clears_the_message(homes):
    home = homes["quadrupteron"]
    far = moved(home, np.array([9.0, 0.0, 0.0, 0.0]))
    assert far.message
    near = moved(far, np.array([0.01, 0.02, 0.0, 0.1]))
    assert not near.message
    assert near.pose.tolist() == [0.01, 0.02, 0.0, 0.1]


@pytest.mark.parametrize("name", QUICK)
def test_a_joint_moves_the_platform_in_its_assembly_mode(homes, name):
    home = homes[name]
    for i in range(home.robot.freedom):
        found = joint_moved(home, i, home.joints[i] + 0.02)
        assert not found.message
        wanted = home.joints
        wanted[i] += 0.02
        assert np.allclose(found.joints, wanted, atol=1e-9)
        stopped = joint_moved(home, i, home.joints[i] + 3.0)
        assert f"of leg {i + 1} stops there" in stopped.message
        assert allowed(home.robot, stopped.pose)


def test_assembly_modes_are_those_of_direct_kinematics(homes):
    state = moved(homes["3-rrr"], homes["3-rrr"].pose + np.array([0.01, 0.0, 0.1]))
    poses = assembly_poses(state)
    all_of_them = pteron.direct_kinematics(state.robot, state.joints)
    assert np.array_equal(poses, all_of_them[~np.isnan(all_of_them).any(axis=-1)])
    now = current_assembly(state, poses)
    assert np.allclose(poses[now], state.pose, atol=1e-9)
    other = poses[1 - now]
    there = assembled(state, other)
    if allowed(state.robot, other):
        assert np.array_equal(there.pose, other)
    else:
        assert "not possible" in there.message
        assert there.pose is state.pose


def test_a_working_mode_keeps_the_pose_or_goes_home(homes):
    home = homes["quadrupteron"]
    kept = in_working_mode(home, [-1, 1, 1, 1])
    assert np.array_equal(kept.pose, home.pose)
    assert not kept.message
    assert [leg.elbow for leg in kept.robot.legs] == [-1, 1, 1, 1]
    delta = in_working_mode(homes["delta"], [-1, -1, -1])
    assert "its home" in delta.message
    assert allowed(delta.robot, delta.pose)


@pytest.mark.parametrize("text", ["-0.5", "half", "0,5", "", "nan", "1e999", "5 kg"])
def test_a_payload_that_cannot_be_changes_nothing(homes, text):
    carries = carrying(homes["delta"], "0.25")
    found = carrying(carries, text)
    assert found.payload == 0.25
    assert found.message.startswith("payload: ")
    assert found.message.endswith("The payload stays 0.25 kg.")
    assert "decimal sign as a point" in found.message or "," not in text


def test_a_typed_pose_is_in_mm_and_degrees(homes):
    robot = homes["quadrupteron"].robot
    assert np.allclose(typed_pose(robot, "10 -20 30.5 90"), [0.01, -0.02, 0.0305, np.pi / 2])
    for text, told in (("1 2", "4 expected: x y z phi"), ("1 2 x 4", "z: 'x' given")):
        with pytest.raises(pteron.DataError, match=told):
            typed_pose(robot, text)


@pytest.mark.parametrize("name", QUICK)
def test_the_numbers_are_the_librarys(homes, name):
    robot = homes[name].robot
    state = carrying(homes[name], "0.3")
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
        assert f"<td>{fixed(force, 2)} {leg.joint.force_unit}</td>" in page
        assert f"<td>{readable(joint, leg.joint.unit)}</td>" in page


def test_where_the_forces_are_not_determined_the_page_says_why():
    robot = pteron.load("quadrupteron")
    state = at_rest(robot, np.array([0.0, 0.0, 0.0, np.pi / 2.0]))
    found = readings(state)
    assert np.isnan(found.forces).all()
    page = readout(state, found)
    assert "No forces here: pose: singular (type II" in page
    assert '<span class="close">close</span>' in page


@pytest.mark.parametrize("name", gated(MECHANISMS))
def test_every_machine_has_its_bodies_where_its_joints_are(name):
    robot = MECHANISMS[name]
    pose = pteron.random_poses(robot, 1, type_i=0.05, type_ii=0.01)[0]
    points, guides = joint_points(robot, pose), joint_guides(robot, pose)
    found = moving_solids(points, guides, 1.0)
    for copies in (found.bars, found.balls, found.blocks):
        assert np.isfinite(copies.positions).all()
        assert np.allclose(np.linalg.norm(copies.turns, axis=-1), 1.0, atol=1e-12)
    # A link is a bar whose ends are two joints: half its length to each side along its own z.
    w, x, y, z = found.bars.turns.T
    way = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=-1)
    half = 0.5 * found.bars.scales[:, 2:] * way
    ends = np.stack([found.bars.positions - half, found.bars.positions + half], axis=1)
    for i, line in enumerate(points.links):
        for pair in pairwise(line[:-1]):
            assert np.abs(ends - np.array(pair)).max(axis=(1, 2)).min() < 1e-12
        assert np.abs(found.balls.positions - line[-1]).max(axis=-1).min() < 1e-12
        assert len(LEG_COLORS) > i
    assert len(found.blocks.positions) == sum(guide.slides for guide in guides)


def test_directions_are_turned_from_z():
    rng = np.random.default_rng(2)
    ways = np.vstack([rng.normal(size=(20, 3)), [0, 0, -2.0], [0, 0, 3.0]])
    w, x, y, z = from_z(ways).T
    turned = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=-1)
    units = ways / np.linalg.norm(ways, axis=-1, keepdims=True)
    assert np.allclose(turned, units, atol=1e-12)


@pytest.fixture(scope="module")
def sessions(homes):
    """Sessions by name, to be left as they are found."""
    return {name: Session(homes[name].robot) for name in ("delta", "five-bar")}


def test_a_slice_holds_the_poses_in_reach(homes):
    state = homes["quadrupteron"]
    span = 0.3 * np.array([[-1.0] * 4, [1.0] * 4])
    (serves, _), (limited, _) = slice_meshes(state.robot, state.pose, "xz", span)
    poses = np.zeros((len(serves[0]), 4))
    poses[:, :3] = serves[0]
    margins = pteron.workspace.pose_margins(state.robot, poses).least
    assert len(poses) > 200
    assert (margins >= 0.0).all()
    assert np.ptp(serves[0][:, 1]) == 0.0
    assert not len(limited[1])
    assert list(choices(state.robot)) == ["none", "xy", "xz", "yz"]


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
    assert is_here(host) == here


# In a real browser.


@contextmanager
def opened(browser, url):
    """A tab with the page, whose first numbers have come."""
    context = browser.new_context(viewport={"width": 1100, "height": 800})
    tab = context.new_page()
    tab.failures = []
    tab.on("pageerror", lambda error: tab.failures.append(str(error)))
    tab.goto(url)
    tab.wait_for_selector("table.legs")
    try:
        yield tab
        assert tab.failures == []
    finally:
        context.close()


SHOWN = """values => {
    const sliders = [...document.querySelectorAll('[role=slider]')];
    return sliders.length >= values.length
        && values.every((value, i) => Number(sliders[i].getAttribute('aria-valuenow')) === value);
}"""
"""Whether the first sliders of a page stand at values."""


def wait_for(tab, condition, argument=None):
    tab.wait_for_function(condition, arg=argument, timeout=60_000)


def said(tab, text):
    """Wait until the page's status says something."""
    wait_for(tab, "text => document.querySelector('[role=status]').innerText.includes(text)", text)
    return tab.inner_text("[role=status]")


def slide(tab, label, keys):
    """Focus a slider by its label and press keys."""
    row = tab.locator(f"text={label}").locator("xpath=ancestor::*[.//*[@role='slider']][1]")
    row.locator("[role=slider]").first.focus()
    for key in keys:
        tab.keyboard.press(key)


@pytest.fixture(scope="module")
def viewer():
    with view(pteron.load("quadrupteron"), port=0) as found:
        yield found
        assert found.faults == ()


@pytest.fixture(scope="module")
def tab(browser, viewer):
    """A tab with the page, for all tests."""
    with opened(browser, viewer.url) as found:
        yield found


@pytest.fixture
def page(tab, viewer):
    """The page, the machine at home and without a payload."""
    viewer.move_to([0.0, 0.0, 0.0, 0.0])
    assert viewer.wait(10.0)
    tab.get_by_role("tab", name="Move").click()
    wait_for(tab, SHOWN, [0.0] * 8)
    return tab


@CLIENTS
def test_a_slider_moves_the_robot_and_the_forces_are_the_librarys(page, viewer):
    before = page.screenshot()
    page.evaluate("() => new Promise(done => setTimeout(done, 500))")
    slide(page, "x (mm)", ["PageUp"] * 3 + ["ArrowRight"] * 5)
    wait_for(page, "() => document.querySelector('table.legs').innerText.includes('.5')")
    assert viewer.wait(10.0)
    pose = viewer.state.pose
    assert pose[0] > 0.0
    assert pose[1:].tolist() == [0.0, 0.0, 0.0]
    still = np.zeros(4)
    forces = pteron.drive_forces(viewer.state.robot, pose, still, still)
    wanted = [fixed(force, 2) for force in forces]
    wait_for(
        page,
        "wanted => [...document.querySelectorAll('table.legs td:nth-child(3)')]"
        ".every((cell, i) => cell.innerText === wanted[i] + ' N')",
        wanted,
    )
    assert page.screenshot() != before


@CLIENTS
def test_a_drag_out_of_reach_stops_and_names_the_leg(page, viewer):
    slide(page, "y (mm)", ["End"])
    text = said(page, "stops")
    assert re.match(r"Leg 1 reaches no further: .* The platform stops \d+\.\d mm before", text)
    assert viewer.wait(10.0)
    assert viewer.state.message == text
    assert allowed(viewer.state.robot, viewer.state.pose)
    # The slider comes back to where the platform is.
    value = float(fixed(1e3 * viewer.state.pose[1]))
    wait_for(
        page,
        "value => [...document.querySelectorAll('[role=slider]')]"
        ".some(one => Math.abs(one.getAttribute('aria-valuenow') - value) < 1e-6)",
        value,
    )


@CLIENTS
def test_the_picture_is_not_blank_and_changes_with_the_pose(page, viewer):
    canvas = page.locator("canvas").first
    page.evaluate("() => new Promise(done => setTimeout(done, 800))")
    before = canvas.screenshot()
    assert len(_colors(page, before)) > 100
    viewer.move_to([0.05, 0.05, 0.1, 0.4])
    wait_for(page, "() => document.querySelector('table.legs').innerText.includes('100.0 mm')")
    page.evaluate("() => new Promise(done => setTimeout(done, 500))")
    assert canvas.screenshot() != before


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


def alike(one, other):
    """Say whether two tabs come to show the same table; each is told by the server in its time."""
    for _ in range(100):
        if one.inner_text("table.legs") == other.inner_text("table.legs"):
            return True
        one.wait_for_timeout(200)
    return False


@CLIENTS
def test_a_reload_and_a_second_tab_show_the_same(page, viewer, browser):
    slide(page, "z (mm)", ["ArrowRight"] * 7)
    slide(page, "phi (°)", ["ArrowRight"] * 9)
    wait_for(page, SHOWN, [0.0, 0.0, 0.7, 0.9])
    assert viewer.wait(10.0)
    with opened(browser, viewer.url) as other:
        assert alike(page, other)
        slide(other, "x (mm)", ["ArrowLeft"] * 3)
        wait_for(page, SHOWN, [-0.3, 0.0, 0.7, 0.9])
        assert viewer.wait(10.0)
        page.reload()
        wait_for(page, SHOWN, [-0.3, 0.0, 0.7, 0.9])
        assert alike(page, other)


def field(tab, label):
    return tab.locator(f"text={label}").locator("xpath=ancestor::*[.//input][1]//input").first


@CLIENTS
def test_a_slice_along_angles_is_shown_in_the_panel(browser):
    with view(pteron.load("ankle"), port=0) as viewer, opened(browser, viewer.url) as tab:
        tab.get_by_role("tab", name="Show").click()
        field(tab, "workspace slice").click()
        tab.get_by_role("option", name="alpha, beta").click()
        drawn = tab.locator("svg[aria-label='Reach over alpha and beta']")
        drawn.wait_for()
        box = drawn.bounding_box()
        assert min(box["width"], box["height"]) > 150.0
        before = drawn.inner_html()
        viewer.move_to(viewer.state.pose + 0.1)
        wait_for(tab, "before => document.querySelector('svg.plot').innerHTML !== before", before)
        field(tab, "workspace slice").click()
        tab.get_by_role("option", name="none").click()
        drawn.wait_for(state="detached")
        assert viewer.faults == ()


@CLIENTS
def test_what_is_typed_wrongly_is_told_on_the_page(page, viewer):
    field(page, "payload (kg)").fill("0.4")
    settled = "() => !document.querySelector('[role=status]').innerText.includes('payload')"
    wait_for(page, settled)
    page.wait_for_timeout(300)
    assert viewer.wait(10.0)
    assert viewer.state.payload == 0.4
    for text in ("-1", "half a kilo"):
        field(page, "payload (kg)").fill(text)
        assert "The payload stays 0.4 kg." in said(page, "a mass of 0 kg or more expected")
    field(page, "payload (kg)").fill("0")
    wait_for(page, settled)
    field(page, "type a pose").fill("10 20 thirty 0")
    page.get_by_role("button", name="Go there").click()
    assert "z: 'thirty' given, a number expected" in said(page, "thirty")
    assert viewer.state.pose.tolist() == [0.0, 0.0, 0.0, 0.0]
    field(page, "type a pose").fill("10 20 30 0")
    page.get_by_role("button", name="Go there").click()
    said(page, "at rest")
    assert viewer.wait(10.0)
    assert np.allclose(viewer.state.pose, [0.01, 0.02, 0.03, 0.0], atol=1e-12)


@CLIENTS
def test_a_malformed_log_is_a_message_and_a_good_one_plays(page, viewer, tmp_path):
    bad, good = tmp_path / "bad.csv", tmp_path / "good.csv"
    bad.write_text("t,x,y,z,phi\n0,0,0,0,0\n0.1,what,0,0,0\n")
    t = np.linspace(0.0, 4.0, 201)
    wave = {"t": t, "x": 0.05 * np.sin(t), "y": 0 * t, "z": 0.1 * np.sin(2 * t), "phi": 0 * t}
    pl.DataFrame(wave).write_csv(good)
    page.get_by_role("tab", name="Play").click()
    page.locator("input[type=file]").first.set_input_files(bad)
    assert "'what'" in said(page, "bad.csv")
    page.locator("input[type=file]").first.set_input_files(good)
    said(page, "moves")
    page.get_by_text("good.csv: 4 s").wait_for()
    # What the box shows comes back from the server, later than `uncheck` would wait.
    page.get_by_role("checkbox", name="play").click()
    said(page, "at rest")


OPENS = """url => new Promise(done => {
    const socket = new WebSocket(url, 'viser-v' + VERSION);
    socket.onmessage = () => done('read');
    socket.onerror = () => done('refused');
})"""


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
    opens = OPENS.replace("VERSION", repr(metadata.version("viser")))
    with other_server() as port:
        tab = browser.new_page()
        for page in ("127.0.0.1", "localhost", "evil.localhost"):
            tab.goto(f"http://{page}:{port}/")
            for asked in ("127.0.0.1", "evil.localhost"):
                assert tab.evaluate(opens, f"ws://{asked}:{local.port}") == "refused"
        # A name that its owner points here: page and socket have the same origin.
        assert tab.goto(f"http://evil.localhost:{local.port}").status == 403
        assert tab.evaluate(opens, f"ws://evil.localhost:{local.port}") == "refused"
        tab.goto(local.url)
        assert tab.evaluate(opens, f"ws://127.0.0.1:{local.port}") == "read"
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
def test_a_lost_connection_and_a_server_that_starts_again(browser):
    robot = pteron.load("five-bar")
    with view(robot, port=0) as first, opened(browser, first.url) as tab:
        port = first.port
        first.close()
        with view(robot, port=port) as second:
            assert second.port == port
            second.move_to([0.01, 0.12])
            assert second.wait(10.0)
            wanted = readable(second.state.joints[0], "rad")
            wait_for(
                tab,
                "text => document.querySelector('table.legs')?.innerText.includes(text)",
                wanted,
            )
            slide(tab, "x (mm)", ["ArrowRight"] * 5)
            wait_for(
                tab,
                "text => !document.querySelector('table.legs')?.innerText.includes(text)",
                wanted,
            )
            assert second.faults == ()


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
        assert f"{fixed(joint, 1)}° {fixed(reads, 1)}° " in table
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
                pictures.append(tab.locator("canvas").first.screenshot())
            assert viewer.faults == ()
    assert len(set(pictures)) == 4
