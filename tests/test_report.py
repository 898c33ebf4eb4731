"""The report: one page that needs nothing else, and numbers that agree with the library."""

import getpass
import json
import re
import socket
from dataclasses import asdict, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from mechanisms import (
    CATALOG,
    CLIENTS,
    MECHANISMS,
    fourfold,
    in_turn,
    random_machine,
    with_elbows,
    with_limits,
)
from page_reader import HOSTILE, Reader, driven, strict

import pteron
from pteron.kinematics.jacobian_at import jacobian_at
from pteron.legs.cones import Cone
from pteron.reduction import FORMS
from pteron.report import write_report
from pteron.report.contents import contents
from pteron.report.costs import PAPER_CLAIM, dense_operations
from pteron.report.page import bodies, geometry, page, symbolic_sums, typeset_account
from pteron.report.typeset import format_fixed, significant, triple
from pteron.report.write import checked_folder, numbers
from pteron.workspace import REACHABLE, pose_margins


def doubtful(robot):
    """Return the machine with a centre of mass beyond the platform joint."""
    leg = robot.legs[0]
    lower = pteron.bodies.PlanarInertia.of_body(leg.lower.mass, (0.09, 0.0), leg.lower.inertia)
    return replace(robot, legs=(replace(leg, lower=lower), *robot.legs[1:]))


def with_a_tool(robot):
    """Return the machine with its tool aside, one ball joint limited, and masses of its own."""
    cone = Cone((0.0, 0.0, 1.0), 1.5)
    legs = (replace(robot.legs[0], platform_cone=cone), *robot.legs[1:])
    legs = tuple(replace(leg, upper=replace(leg.upper, mass=1.01 * leg.upper.mass)) for leg in legs)
    platform = replace(robot.platform, tool=(0.05, 0.02, -0.1))
    return replace(robot, name="with a shaft", platform=platform, legs=legs)


MACHINES = {
    "quadrupteron": CATALOG["quadrupteron"],
    "driven": driven(CATALOG["tripteron"]),
    "weightless, other mode": replace(
        with_elbows(MECHANISMS["tripteron on a wall"], "+-+"), gravity=(0.0, 0.0, 0.0)
    ),
    "hostile": replace(with_limits(doubtful(CATALOG["tripteron"]), -0.05, 0.08), name=HOSTILE),
    "delta": CATALOG["delta"],
    "mixed": MECHANISMS["random PRR 0"],
    "shaft": with_a_tool(CATALOG["delta-4"]),
    "planar": CATALOG["3-rrr"],
}
EVERY = in_turn(MACHINES, ("quadrupteron", "hostile"), share=1)


@lru_cache
def report(name):
    return contents(MACHINES[name])


@lru_cache
def html(name):
    return page(report(name))


@lru_cache
def read(name):
    return Reader(html(name))


@lru_cache
def scene(name):
    return json.loads(read(name).scripts["scene"])


@EVERY
def test_the_page_is_whole_and_needs_nothing_else(name):
    found = read(name)
    assert found.faults == []
    assert found.open == []
    assert found.sources == []
    assert "link" not in found.counts
    assert "img" not in found.counts
    for word in ("http", "@import", "url(//", "fetch(", "XMLHttpRequest", "import("):
        assert word not in html(name)
    assert len(set(found.ids)) == len(found.ids)
    assert found.links
    for link in found.links:
        assert link.startswith("#")
        assert link[1:] in found.ids
    wanted = set(re.findall(r'getElementById\("(\w+)"\)', found.scripts[None]))
    assert wanted <= set(found.ids)
    assert found.counts["canvas"] == 1
    measures = {"quadrupteron": 1, "delta": 2, "mixed": 2, "shaft": 2, "planar": 3}.get(name, 0)
    assert found.counts["svg"] == (5 if name == "planar" else 7) + measures
    assert found.counts["h1"] == 1


def test_the_page_says_nothing_of_this_computer():
    name = "quadrupteron"
    for word in (str(Path.home()), str(Path.cwd()), socket.gethostname(), "site-packages", "/tmp"):
        assert len(word) < 4 or word not in html(name)
    user = getpass.getuser()
    assert len(user) < 4 or user == "root" or user not in html(name)


@CLIENTS
@EVERY
def test_no_number_is_missing(name):
    for word in ("nan", "None", "Undefined", "inf", "{{", "{%"):
        text = read(name).text.replace(HOSTILE, "")
        assert not re.search(rf"(?<!\w){re.escape(word)}(?!\w)", text), word
    assert not re.search(r"(?<!\de)-\d", text), "a hyphen where a minus belongs"


@CLIENTS
def test_a_name_is_text_wherever_it_stands():
    found = read("hostile")
    assert HOSTILE in found.text
    assert "b" not in found.counts or "<b onload" not in html("hostile")
    assert html("hostile").count("</script>") == found.counts["script"] == 2


@EVERY
def test_3t_machines_have_no_angle(name):
    turns, shown = MACHINES[name].platform.turns, name in ("quadrupteron", "planar")
    assert ("φ" in read(name).text) == turns
    assert ("singular, " in read(name).text) == shown
    assert (report(name).orientations is None) != shown


@CLIENTS
def test_a_page_is_the_same_each_time():
    assert page(report("hostile")) == html("hostile")


@CLIENTS
@EVERY
def test_the_moving_picture_is_the_machine(name):
    robot, data = MACHINES[name], scene(name)
    frames = len(data["time"])
    assert frames == 240
    for i, leg in enumerate(robot.legs):
        chain = np.array([legs[i] for legs in data["chains"]])
        lengths = [q.value[0] for q in leg.quantities if q.role == "length"]
        links = np.linalg.norm(np.diff(chain, axis=1), axis=-1)
        assert links.shape == (frames, max(len(lengths), 1))
        if lengths:  # a shaft has none
            np.testing.assert_allclose(links, np.tile(lengths, (frames, 1)), atol=3e-6)
    pose = np.array(data["pose"])
    np.testing.assert_allclose(
        pteron.inverse_kinematics(robot, pose), data["coordinates"], atol=5e-5
    )
    assert data["slides"] == [leg.joint.noun == "slider" for leg in robot.legs]
    for i, slides in enumerate(data["slides"]):
        path = np.array(data["guides"][i])
        at = np.array([legs[i] for legs in data["chains"]])[:, 0 if slides or len(path) == 1 else 1]
        step = np.linalg.norm(np.diff(path, axis=0), axis=-1).max(initial=1e-6)
        assert np.linalg.norm(at[:, None] - path, axis=-1).min(axis=-1).max() <= step
    assert [bar is not None for bar in data["bars"]] == [leg.bar is not None for leg in robot.legs]
    assert [np.shape(part["corners"])[:1] for part in data["parts"]] == [
        (frames,) for _ in report(name).shown.points.parts
    ]
    assert (data["tool"] is None) == (not any(robot.platform.tool))
    assert data["planar"] == robot.platform.planar
    k = len(robot.platform.lengths)
    np.testing.assert_allclose(np.array(data["position"])[:, :k], pose[:, :k], atol=2e-6)
    gravity = np.array(robot.gravity)
    assert np.any(data["gravity"]) == bool(gravity.any())
    if data["planar"]:  # seen along the normal
        assert data["up"] == [0.0, 0.0, 1.0]
        assert not np.array(data["position"])[:, 2].any()
    elif gravity.any():
        np.testing.assert_allclose(data["up"], -gravity / np.linalg.norm(gravity), atol=1e-6)
    # The last frame is followed by the first: no jump, and no frame twice.
    steps = np.diff(np.append(data["time"], data["duration"]))
    np.testing.assert_allclose(steps, steps[0], atol=2e-6)


@EVERY
def test_the_numbers_are_the_librarys(name):
    robot = MACHINES[name]
    data = strict(json.dumps(numbers(report(name))))
    cycle = data["cycle"]
    state = [np.array(cycle[key]) for key in ("pose", "velocity", "acceleration")]
    forces = np.array(cycle["forces"])
    rigid = pteron.inverse_dynamics(robot, *state)
    expected = pteron.drive_forces(robot, *state, smooth=True) if name == "driven" else rigid
    np.testing.assert_allclose(expected, forces, atol=1e-10)
    assert cycle["with_drives"] == (np.abs(forces - rigid).max() > 1.0) == (name == "driven")
    assert [text[:5] for text in cycle["overloads"]] == (["leg 3"] if name == "driven" else [])
    drive = strict(json.dumps(asdict(robot.legs[1].drive))) if name == "driven" else None
    assert data["drives"][1] == drive
    # The report looks between the samples too.
    np.testing.assert_allclose(np.abs(forces).max(axis=0), cycle["peak_forces"], rtol=1e-3)
    mean = np.trapezoid(forces**2, cycle["time"], axis=0) / cycle["duration"]
    np.testing.assert_allclose(np.sqrt(mean), cycle["rms_forces"], rtol=1e-3)
    power = forces * (pteron.jacobian(robot, state[0]) @ state[1][..., None])[..., 0]
    for i, row in enumerate(data["motors"]):
        assert row["peak_power"] == pytest.approx(power[:, i].max(), rel=1e-3)
        assert row["peak_force"] == cycle["peak_forces"][i]
    speeds = (pteron.jacobian(robot, state[0]) @ state[1][..., None])[..., 0]
    np.testing.assert_allclose(np.abs(speeds).max(axis=0), cycle["peak_speeds"], 1e-3, 1e-12)
    joints = pteron.inverse_kinematics(robot, state[0])
    np.testing.assert_array_equal(cycle["joints"]["least"], joints.min(axis=0))
    np.testing.assert_array_equal(cycle["joints"]["greatest"], joints.max(axis=0))
    assert all(cycle["joints"]["within"])
    assert [joint["force_unit"] for joint in data["joints"]] == [
        leg.joint.force_unit for leg in robot.legs
    ]
    home = data["home"]
    np.testing.assert_array_equal(home["jacobian"], pteron.jacobian(robot, home["pose"]))
    assert home["reserve"] > 0.4
    assert home["condition_number"] >= 1.0
    base = pteron.base_parameters(robot)
    assert data["base_parameters"]["rank"] == base.rank == len(data["base_parameters"]["values"])
    np.testing.assert_allclose(data["base_parameters"]["values"], base.values())
    assert data["reach"]["unit"] == ("m^2" if robot.platform.planar else "m^3")
    if name in ("quadrupteron", "planar"):
        singular = pteron.kinematics.singular_orientations(robot, home["pose"][:-1])
        assert len(singular) == 2
        np.testing.assert_allclose(data["singular_orientations"], singular)
    else:
        assert data["singular_orientations"] is None


@EVERY
def test_the_page_shows_the_numbers(name):
    found, text = report(name), read(name).text
    loads = found.sizing
    for values in (loads.peak_forces, loads.rms_forces, loads.peak_speeds, loads.peak_power):
        for value in values[values > 1e-12 * values.max()]:  # the rest is rounding
            assert significant(float(value)) in text
    joints = {leg.joint.noun: leg.joint.force_unit for leg in found.robot.legs}
    for noun in ("slider", "crank", "shaft"):
        assert (noun in text.replace("the slider is tilted", "")) == (noun in joints)
    template = "forces and torques depend on these masses"  # whatever the joints
    assert ("torque" in text.replace(template, "")) == ("crank" in joints)
    for words in ("in a plane", "Workspace area", "dm²", "lies in the machine's plane"):
        assert (words in text) == (name == "planar")
    for words in ("counts as a point mass", "way of the tool's centre point", "Passive joints"):
        assert (words in text) == (name == "shaft")
    for words in ("Drives, at the joints", "4.626 4.626"):
        assert (words in text) == (name == "driven"), words
    assert ("friction is left out" in text) == (name != "driven")
    assert all(line in text for line in loads.overloads)
    assert ("best ratio" in text) == (name == "driven")
    assert significant(found.jacobian.condition, 4) in text
    for i, value in enumerate(found.base.values(), start=1):
        assert significant(float(value), 4) in text
        assert f"P b{i} " in text
    for cost in found.costs:
        assert str(cost.operations) in text
        assert cost.note in text
    doubtful = name in ("hostile", "mixed")
    assert ("Possible, but unlikely" in text) == bool(found.doubts) == doubtful
    assert all(doubt.replace("-", "\u2212") in text for doubt in found.doubts)


def test_costs_come_in_pairs_with_percentages_of_the_counts():
    found = report("quadrupteron")
    assert PAPER_CLAIM in html("quadrupteron")
    *pairs, cheapest = found.costs
    assert len(pairs) == 2 * (1 + len(FORMS))
    assert cheapest.operations < pairs[-1].operations < pairs[-2].operations
    for complete, reduced in zip(pairs[::2], pairs[1::2], strict=True):
        share = 100.0 * (1.0 - reduced.operations / complete.operations)
        assert reduced.note == f"{share:.0f} % fewer"
        assert complete.note == ""
        assert f"{found.base.rank} parameters" in reduced.form
    # By hand: 4 x 4 by 4 x 4 sliders, 8 links of 4 x 6 by 6 x 4, elimination, D P.
    products = 4 * 4 * 7 + 8 * (4 * 4 * 11)
    assert dense_operations(found.base, range(40)) == products + 43 + 2 * 16 * 40 + 4 * 79


@CLIENTS
def test_measures_are_shown_where_they_depend_on_the_position():
    assert report("quadrupteron").measures is report("hostile").measures is None
    assert report("planar").measures.cut.plane == "xy"
    found = report("delta").measures
    assert found.cut.plane == "xz", "upright"
    inside = found.cut.status == REACHABLE
    poses = np.stack(np.meshgrid(found.cut.first, found.cut.second), axis=-1)[inside]
    expected = pose_margins(CATALOG["delta"], np.insert(poses, 1, report("delta").home[1], axis=-1))
    np.testing.assert_allclose(found.type_i[inside], expected.type_i.min(axis=-1), rtol=1e-12)
    np.testing.assert_allclose(found.type_ii[inside], expected.type_ii, rtol=1e-12)
    assert "depends on the position" in read("delta").text


def test_the_slices_share_a_scale():
    cuts = report("quadrupteron").slices
    widths = [np.ptp(axis) for cut in cuts for axis in (cut.first, cut.second)]
    np.testing.assert_allclose(widths, widths[0])
    box = report("quadrupteron").volume.box
    for cut in cuts:
        for axis, letter in ((cut.first, cut.plane[0]), (cut.second, cut.plane[1])):
            low, high = box[:, "xyz".index(letter)]
            assert axis[0] < low < high < axis[-1]


def test_the_platforms_inertia_is_told_with_all_its_parts():
    robot = MACHINES["shaft"]
    rows = [(name, values) for name, leg, values in bodies(robot) if leg is None]
    names = [name for name, _ in rows]
    assert names[0] == "platform"
    assert names[-1] == "platform with all of it"
    own = robot.platform
    assert len(names) == 2 + len(own.bars) + len(own.geared)
    parts = [values.get("m", 0.0) for _, values in rows[:-1]]
    assert rows[-1][1]["m"] == pytest.approx(sum(parts))
    assert rows[-1][1]["I"] == own.total_inertia.inertia
    assert [name for name, leg, _ in bodies(MACHINES["delta"]) if leg is None] == ["platform"]


@CLIENTS
def test_the_condition_number_mixes_no_units():
    # In millimetres a machine is the same machine.
    robot = CATALOG["quadrupteron"]
    found = report("quadrupteron").jacobian
    assert found.radius == pytest.approx(0.04)
    scaled = found.matrix / [1.0, 1.0, 1.0, found.radius]
    assert found.condition == pytest.approx(1.0 + np.sqrt(2.0))
    assert found.condition == pytest.approx(np.linalg.cond(scaled))
    assert robot.platform.turns
    assert report("hostile").jacobian.condition == pytest.approx(1.0)
    # The shaft of a Delta adds what the legs have nothing to do with.
    assert report("shaft").jacobian.radius is None
    three = np.linalg.cond(report("shaft").jacobian.matrix[:3, :3] * CATALOG["delta"].legs[0].lever)
    assert report("shaft").jacobian.condition == pytest.approx(three)
    assert "the shaft's angle as \u03c6, whatever its ratio" in read("shaft").text


def test_a_shafts_gear_does_not_count_in_the_condition_number():
    robot = CATALOG["delta-4"]
    *cranks, shaft = robot.legs
    found = []
    for point in ((0.0, 0.0, 0.0), (0.1, 0.05, 0.0)):  # the second: the legs' joints turn with phi
        legs = [replace(leg, platform_point=point) for leg in cranks]
        for ratio in (1.0, -8.0):
            geared = replace(shaft, ratio=ratio, limits=(-25.0, 25.0))
            machine = replace(robot, legs=(*legs, geared))
            found.append(jacobian_at(machine, np.array([0.1, 0.0, -1.0, 0.0])).condition)
    assert found[0] == pytest.approx(found[1])
    assert found[2] == pytest.approx(found[3])


@CLIENTS
def test_what_turns_a_platform_does_not_carry_it():
    assert "three legs of crank and rod carry a platform that translates" in read("shaft").text
    assert "(3T1R, Schoenflies motion); a shaft turns it." in read("shaft").text


@CLIENTS
def test_a_cone_has_one_limit_on_the_page():
    assert "at most 85.9\u00b0" in read("shaft").text
    assert "\u221285.9" not in read("shaft").text


def test_the_geometry_has_a_column_a_leg():
    for name, machine in MACHINES.items():
        rows = geometry(machine)
        assert len({label for label, _ in rows}) == len(rows)
        assert all(len(texts) == len(machine.legs) for _, texts in rows), name


@CLIENTS
def test_the_measures_show_what_is_reached():
    for name in ("delta", "mixed", "shaft", "planar"):
        inside = report(name).measures.cut.status == REACHABLE
        for axis in (0, 1):
            reached = np.flatnonzero(inside.any(axis=axis))
            assert np.ptp(reached) > 0.8 * len(inside)
            assert 0 < reached[0] < reached[-1] < len(inside) - 1


@CLIENTS
def test_symbols_stand_for_their_numbers():
    for base in (report("quadrupteron").base, report("delta").base):
        found = symbolic_sums(base)
        names = [re.sub("<[^>]*>", "", line) for line, _ in found["lengths"]]
        values = {n: v for n, (_, v) in zip(names, found["lengths"], strict=True)}
        for line, expected in zip(found["sums"], base.expressions(digits=12), strict=True):
            text = re.sub(r"<sup>(\d)</sup>", r"**\1", line)
            text = re.sub("<[^>]*>", "", text).replace("\u2212", "-").replace("\u202f", "*")
            given = [eval(size, {}, values) for size in re.findall(r"\((.*?)\) [mI]", text)]
            sizes = [abs(float(s)) for s in re.findall(r"([\d.]+) [mI]", expected)]
            # Factors of one are not written as numbers, but may be as symbols that cancel.
            np.testing.assert_allclose(np.abs([g for g in given if g != 1.0]), sizes)
    assert "In symbols of the geometry" in read("quadrupteron").text
    numerical = pteron.base_parameters(CATALOG["tripteron"], "svd")
    assert symbolic_sums(numerical) is None
    text = Reader(page(replace(report("hostile"), base=numerical))).text
    assert "In symbols of the geometry" not in text


def test_the_folder_is_checked_before_the_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def interrupted(robot, motion):
        raise KeyboardInterrupt

    monkeypatch.setattr("pteron.report.contents.contents", interrupted)
    file = tmp_path / "file"
    file.write_text("mine")
    with pytest.raises(pteron.OutputError, match="it is a file"):
        write_report(CATALOG["tripteron"], file)
    assert file.read_text() == "mine"
    with pytest.raises(KeyboardInterrupt):
        write_report(CATALOG["tripteron"], tmp_path / "a" / "b")
    assert list(tmp_path.iterdir()) == [file], "an interruption leaves nothing behind"
    with pytest.raises(pteron.OutputError, match="name is empty"):
        checked_folder("")


def test_machines_that_cannot_work_are_refused(tmp_path: Path):
    mine = tmp_path / "mine.txt"
    mine.write_text("mine")
    with pytest.raises(pteron.ModelError):
        write_report(with_limits(CATALOG["quadrupteron"], 3.0, 4.0), tmp_path / "none")
    for folder in (tmp_path, tmp_path / "none"):
        with pytest.raises(pteron.SingularPose, match="singular at every pose"):
            write_report(fourfold(), folder)
    assert list(tmp_path.iterdir()) == [mine], "what was there stays, and nothing is left behind"


def test_numbers_as_people_read_them():
    assert significant(0.0) == "0"
    assert significant(999.6) == "1000"
    assert significant(0.00099999, 3) == "0.00100"
    assert significant(float("inf")) == "∞"
    assert format_fixed(-0.04) == "0.0"
    assert triple((1 / 3, -1e-17, 2.0)) == "(0.3333, 0, 2)"
    last = report("quadrupteron").base.expressions("html")[-1]
    assert last == "<i>m</i><sub>e</sub> \u2212 625\u202f<i>I</i><sub>e</sub>"
    account = "its point s0 is p - r . d, rho"
    assert typeset_account(account) == (
        "its point <b>s</b><sub>0</sub> is <b>p</b> \u2212 <b>r</b> \u00b7 <b>d</b>, \u03c1"
    )


@pytest.mark.parametrize("kinds", ["SRP", "LCC"])
def test_of_mixed_legs_the_upper_length_stands_before_the_lower(kinds):
    rows = [name for name, _ in geometry(random_machine(3, kinds))]
    assert rows.index("lower length") == rows.index("upper length") + 1
