"""What `check` says of machines as they are built: their home, how drives hold it, legs' places."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from built_machines import SORTS, least_singular_value, machine_text
from mechanisms import CATALOG, CLIENTS, TILTED, gated, random_machine, scaled
from typer.testing import CliRunner

import pteron
from pteron.cli.main import app
from pteron.kinematics.singular_distance import coordinate_distances
from pteron.kinematics.unit_rows import row_frame, unit_rows
from pteron.manipulator import with_dimensions
from pteron.manipulator.commented_file import commented_text
from pteron.manipulator.machine_warnings import machine_warnings
from pteron.manipulator.template import template_sentence
from pteron.thresholds import (
    CROSSING,
    HOLDING_FORCE,
    HOLDING_FORCE_NEAR,
    INACCURATE,
    LEAST_SINGULAR_VALUE,
    SAME_PLACE,
    STOUT_LINK,
    rounding_tolerance,
)
from pteron.workspace import home_pose, home_poses, pose_margins
from pteron.workspace.holding import holding_warnings, measure_holding
from pteron.workspace.leg_layout import layout_warnings

BUILT = Path(__file__).parent / "data" / "built"
MACHINES = CATALOG | TILTED
HOMES = {
    "3-prr": [0.0, 0.0, -0.08727],
    "3-rpr": [0.0, 0.0, -0.34907],
    "3-rrr": [0.0, 0.0, 0.0],
    "ankle": [0.0, 0.0],
    "ball-table": [0.12, 0.0, 0.0],
    "delta": [0.0, 0.0, -1.0],
    "delta-4": [0.0, 0.0, -1.0, 0.0],
    "delta-omnid": [0.0, 0.0, 0.36],
    "five-bar": [0.0, 0.138],
    "h4": [0.0, 0.129, -0.345, 0.0],
    "hexa": [0.0, 0.0, -0.73, 0.0, 0.0, 0.0],
    "hexaglide": [0.0, 0.081, -0.735, 0.0, 0.0, 0.0],
    "linear-delta": [0.0, 0.0, 0.05],
    "orthoglide": [-0.04, -0.04, -0.04],
    "par4": [0.0, 0.0, -0.45, 0.0],
    "quadrupteron": [0.0, 0.0, 0.0, 0.0],
    "quadrupteron-oblique": [0.01, 0.03, -0.06, 0.0],
    "reachy-mini": [0.0, 0.0, 0.177, 0.0, 0.0, 0.0],
    "rubin-camera-hexapod": [0.0] * 6,
    "rubin-m2-hexapod": [0.0] * 6,
    "sprint-z3": [0.55, 0.0, 0.0],
    "stewart": [0.0, 0.0, 2.0, 0.0, 0.0, 0.0],
    "tripteron": [-0.01, -0.01, -0.01],
    "tripteron-colinear": [0.0, 0.0, 0.1],
    "tripteron-oblique": [-0.02, -0.09, -0.05],
    "tripteron-router": [0.01, 0.01, 0.01],
    "wrist": [0.0, 0.0, 0.0],
}
"""Homes as they were found by random sampling."""


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def check(path, *, code=0):
    """Return what `pteron check --json` finds, and its warnings; None where it fails."""
    result = CliRunner().invoke(app, ["check", str(path), "--json"])
    assert result.exit_code == code, result.stderr
    return (json.loads(result.stdout) if code == 0 else None), result.stderr


@pytest.mark.parametrize("name", HOMES)
def test_homes_of_the_catalog_stay_where_they_were(name):
    robot = MACHINES[name]
    size = max(leg.size for leg in robot.legs)
    unit = np.where(robot.platform.angular, 1.0, size)
    assert np.abs((home_pose(robot) - HOMES[name]) / unit).max() <= 2e-3
    assert home_poses(robot).mirror is None


@pytest.mark.parametrize(
    "name", gated(["par4", "stewart", "five-bar", "hexa"], {"par4", "stewart"}, CLIENTS)
)
def test_a_machine_at_a_thousandth_has_the_same_home_scaled(name):
    robot = MACHINES[name]
    small = scaled(robot, 1e-3)
    home, unit = home_pose(robot), np.where(robot.platform.angular, 1.0, 1e-3)
    assert np.allclose(home_pose(small), unit * home, rtol=0.0, atol=1e-9)
    assert pose_margins(small, unit * home).least == pytest.approx(pose_margins(robot, home).least)


def test_short_cranks_stand_level_above_their_base_with_horizontal_cranks():
    """Of 1048576 random poses 68 were in reach, and the machine was refused."""
    robot = pteron.load(BUILT / "short-cranks.toml")
    home = home_pose(robot)
    assert np.allclose(home, [0.0, 0.0, 0.133, 0.0, 0.0, 0.0], rtol=0.0, atol=1e-3)
    assert np.abs(pteron.inverse_kinematics(robot, home)).max() < 0.1


@pytest.mark.parametrize(("name", "height"), [("rams", 0.49), ("rams-no-cones", 0.697)])
def test_rams_stand_above_their_base_and_the_image_below_is_told(name, height):
    found, errors = check(BUILT / f"{name}.toml")
    assert errors == ""
    assert found["home_pose"][2] == pytest.approx(height, abs=5e-3)
    assert found["mirror_pose"][2] == pytest.approx(-height, abs=5e-3)
    shown = CliRunner().invoke(app, ["check", str(BUILT / f"{name}.toml")]).stdout
    assert "mirror image on the other side of the base: (0, 0, -0." in shown


def test_an_upright_five_bar_stands_against_gravity():
    robot = replace(CATALOG["five-bar"], gravity=(0.0, 9.81, 0.0))
    for sign, upright in ((1.0, robot), (-1.0, replace(robot, gravity=(0.0, -9.81, 0.0)))):
        both = home_poses(upright)
        if both.mirror is not None:
            assert sign * both.pose[1] < 0.0 < sign * both.mirror[1]


def test_a_file_names_its_home(tmp_path):
    text = (BUILT / "rams.toml").read_text("utf-8")
    path = tmp_path / "below.toml"
    named = text.replace(
        "[platform]", "[home]\npose = [0.0, 0.0, -0.48, 0.0, 0.0, 0.0]\n\n[platform]", 1
    )
    path.write_text(named, "utf-8")
    robot = pteron.load(path)
    assert robot.home == (0.0, 0.0, -0.48, 0.0, 0.0, 0.0)
    assert home_pose(robot).tolist() == list(robot.home)
    assert pteron.load(pteron.save(robot, tmp_path / "again.toml")) == robot
    assert "from the file" in CliRunner().invoke(app, ["check", str(path)]).stdout
    # Another working mode, other dimensions or a turn have no use for it as it stands.
    assert with_dimensions(robot, limits=(0.5, 0.7)).home is None
    quarter = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    assert np.allclose(pteron.turned(robot, quarter).home[:3], [0.0, 0.48, 0.0])


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        ("[0.0, 0.0, 0.48]", "home.pose: 3 values given, 6 expected: x, y, z, roll, pitch, yaw"),
        ("[0.0, 0.0, nan, 0.0, 0.0, 0.0]", "home.pose"),
        ("0.48", "home.pose"),
        ("[0.0, 0.0, 0.2, 0.0, 0.0, 0.0]", "leg 6 is out of reach or beyond a limit there"),
    ],
)
def test_homes_that_cannot_be_are_refused_in_a_line(tmp_path, pose, words):
    path = tmp_path / "robot.toml"
    text = (BUILT / "rams.toml").read_text("utf-8")
    path.write_text(text.replace("[platform]", f"[home]\npose = {pose}\n\n[platform]", 1), "utf-8")
    _, errors = check(path, code=2)
    assert words in errors
    assert errors.count("\n") == 1


def test_a_hexapod_of_similar_rounded_hexagons_is_refused_with_the_reason():
    """Its holding forces are 363 kN at its best pose, and it was called fine."""
    _, errors = check(BUILT / "rounded-hexagons.toml", code=2)
    assert re.search(
        r"singular everywhere within 0\.1\d* um of these coordinates \(type II\)", errors
    )
    assert "similar figures within 0.6 um" in errors


def hexagons(shift, digits):
    """Return a hexapod of rams on similar hexagons but for a shift of one platform point, m."""
    robot = pteron.load(BUILT / "rounded-hexagons.toml")
    legs = []
    for i, leg in enumerate(robot.legs):
        guide = np.array(leg.guide_point)
        point = np.round(2.0 / 3.0 * guide + [shift * (i == 0), 0.0, 0.0], digits)
        legs.append(replace(leg, guide_point=np.round(guide, digits), platform_point=point))
    return replace(robot, legs=tuple(legs))


@pytest.mark.parametrize(
    "command", [["report", "--out", "page"], ["size"], ["export", "--mjcf", "."]]
)
def test_no_command_goes_on_with_similar_hexagons(command):
    name, *options = command
    result = CliRunner().invoke(app, [name, str(BUILT / "rounded-hexagons.toml"), *options])
    assert result.exit_code == 2
    assert "singular everywhere within 0.15 um of these coordinates" in result.stderr


@pytest.mark.parametrize("digits", [4, 5, 6])
def test_the_verdict_on_similar_hexagons_survives_rounding(digits):
    robot = hexagons(0.0, digits)
    pose = [[0.05, -0.1, 0.7, 0.1, -0.2, 0.3]]
    assert coordinate_distances(robot, np.array(pose))[0] < 1e-4
    pteron.save(robot, "robot.toml")
    # Six digits of two thirds happen to lie on conics exactly, which is proved.
    words = r"singular (everywhere within|at every pose \(type II\): .* on conics)"
    assert re.search(words, check("robot.toml", code=2)[1])


def test_the_distance_to_singular_coordinates_is_that_of_a_change_that_makes_them_so():
    """Moved by it along the slopes' signs, the least singular value falls to second order."""
    robot = TILTED["stewart"]
    pose = np.array([[0.2, -0.1, 1.9, 0.1, 0.05, -0.2]])
    before = least_singular_value(robot, pose[0])
    distance = coordinate_distances(robot, pose)[0]
    step, slopes = 0.02 * distance, []
    for i, leg in enumerate(robot.legs):
        for key in ("guide_point", "platform_point"):
            for k in range(3):
                moved = np.array(getattr(leg, key))
                moved[k] += 1e-6
                legs = [*robot.legs]
                legs[i] = replace(leg, **{key: moved})
                after = least_singular_value(replace(robot, legs=tuple(legs)), pose[0], robot)
                slopes.append((i, key, k, (after - before) / 1e-6))
    legs = [*robot.legs]
    for i, key, k, slope in slopes:
        moved = np.array(getattr(legs[i], key))
        moved[k] -= step * np.sign(slope)
        legs[i] = replace(legs[i], **{key: moved})
    lowest = least_singular_value(replace(robot, legs=tuple(legs)), pose[0], robot)
    assert distance == pytest.approx(before / sum(abs(s) for *_, s in slopes), rel=1e-2)
    assert lowest == pytest.approx(0.98 * before, rel=2e-3)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("swapped-legs", "legs 2 and 3: look swapped"),
        ("swapped-rams", "legs 1 and 2: look swapped"),
    ],
)
def test_swapped_legs_are_doubted(name, words):
    found, errors = check(BUILT / f"{name}.toml")
    assert words in errors
    assert "their links cross at home" in errors
    assert sum("swapped" in doubt for doubt in found["doubts"]) == 1


@pytest.mark.parametrize("name", ["delta", "motion-base", "short-cranks", "rams"])
def test_their_originals_are_not(name):
    found, errors = check(BUILT / f"{name}.toml")
    assert (found["doubts"], errors) == ([], "")


@pytest.mark.parametrize("name", MACHINES)
def test_no_machine_of_the_catalog_is_doubted(name):
    robot = MACHINES[name]
    home = home_pose(robot)
    of = measure_holding(robot, home)
    assert (layout_warnings(robot, home), holding_warnings(of)) == ((), ())
    assert of.least_singular_value > 0.3
    assert of.everywhere > 20.0 * of.rounding
    assert template_sentence(robot) == ""


def test_one_leg_out_of_place_or_of_another_length_is_doubted():
    robot = pteron.load(BUILT / "motion-base.toml")
    home = home_pose(robot)
    moved = np.add(robot.legs[3].platform_point, (0.02, 0.0, 0.0))
    legs = [*robot.legs]
    legs[3] = replace(legs[3], platform_point=moved)
    (warning,) = layout_warnings(replace(robot, legs=tuple(legs)), home)
    assert warning.startswith("leg 4: guide_point or platform_point: out of place")
    delta = pteron.load(BUILT / "delta.toml")
    legs = [*delta.legs]
    legs[1] = replace(legs[1], lower_length=0.45)
    (warning,) = layout_warnings(replace(delta, legs=tuple(legs)), home_pose(delta))
    assert warning.startswith("leg 2: lower_length: 0.45 m, while all other legs have 0.42 m")


def test_shifted_legs_of_a_delta_are_doubted():
    """Each rod is joined to its neighbour's place, as if the platform had turned."""
    delta = pteron.load(BUILT / "delta.toml")
    points = [leg.platform_point for leg in delta.legs]
    legs = [
        replace(leg, platform_point=p)
        for leg, p in zip(delta.legs, points[1:] + points[:1], strict=True)
    ]
    robot = replace(delta, legs=tuple(legs))
    assert "legs 1, 2 and 3: look swapped" in layout_warnings(robot, home_pose(robot))[0]


@pytest.mark.parametrize("key", ["tool", "center_of_mass"])
def test_what_stands_beside_the_pin_of_a_five_bar_is_doubted(key):
    """A pen on an extended link turns with the link; `check` said "Fine"."""
    robot = pteron.load("five-bar")
    if key == "tool":
        platform = replace(robot.platform, tool=(0.03, 0.0, 0.0))
    else:
        inertia = replace(robot.platform.inertia, first_moment=(0.0, 0.03 * 0.03), inertia=3e-5)
        platform = replace(robot.platform, inertia=inertia)
    (warning,) = machine_warnings(replace(robot, platform=platform))
    assert warning.startswith(f"platform: {key}: 30 mm beside the pin where the links meet")


def test_a_tool_above_the_pin_or_on_a_platform_that_is_kept_parallel_is_not():
    for name, tool in (("five-bar", (0.0, 0.0, -0.05)), ("delta", (0.03, 0.0, -0.05))):
        robot = pteron.load(name)
        assert machine_warnings(replace(robot, platform=replace(robot.platform, tool=tool))) == ()


def check_of_a_built_machine(sort, seed):
    path = Path("robot.toml")
    path.write_text(machine_text(sort, seed), "utf-8")
    found, _ = check(path)
    robot, home = pteron.load(path), np.array(found["home_pose"])
    height = dict(zip(robot.coordinates, home, strict=True))[
        "z" if sort != "tripod" else robot.coordinates[0]
    ]
    assert height > 0.0
    assert pose_margins(robot, home).least > 0.0
    value = found["holding"]["least_singular_value"]
    if sort != "tripod":
        assert value == pytest.approx(least_singular_value(robot, home), rel=1e-6)
    fine = not found["doubts"]
    assert value >= 1e-4 or not fine
    # What is doubted of them is that links cross, as inward cranks of neighbours do.
    assert all("links cross at home" in doubt for doubt in found["doubts"])


@pytest.mark.parametrize("seed", gated(range(30), {0, 1}, CLIENTS))
@pytest.mark.parametrize("sort", SORTS)
def test_machines_as_they_are_built_are_answered_at_once(sort, seed):
    check_of_a_built_machine(sort, seed)


@pytest.mark.parametrize("seed", gated(range(30), {0}))
@pytest.mark.parametrize("sort", SORTS)
@CLIENTS
def test_machines_as_they_are_built_are_reported_and_exported(sort, seed):
    """The report's page and the files of engines and controllers, all at the pose of `check`."""
    path = Path("robot.toml")
    path.write_text(machine_text(sort, seed), "utf-8")
    answer, _ = check(path)
    commands = [["report", "--out", "page"]]
    commands += [
        ["export", f"--{kind}", kind] for kind in ("c", "mjcf", "urdf", "sdf", "pinocchio")
    ]
    for name, *options in commands:
        result = CliRunner().invoke(app, [name, str(path), *options])
        assert result.exit_code == 0, result.stderr
    page = json.loads(Path("page/report.json").read_text("utf-8"))
    assert page["home"]["pose"] == pytest.approx(answer["home_pose"])
    assert page["doubts"][: len(answer["doubts"])] == answer["doubts"]
    mujoco = pytest.importorskip("mujoco")
    (name,) = Path("mjcf").iterdir()
    model = mujoco.MjModel.from_xml_path(str(name))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    assert np.abs(data.efc_pos[data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY]).max() < 1e-9
    for file in (file for file in Path().rglob("*") if file.suffix in {".xml", ".urdf", ".sdf"}):
        assert not re.search(r"\bnan\b|\binf\b", file.read_text("utf-8")), file


def test_templates_keep_their_centres_of_mass_where_mass_is_edited(tmp_path):
    path = tmp_path / "robot.toml"
    robot = with_dimensions("delta", base_radius=0.18, crank=0.2, rod=0.42)
    text = commented_text("delta", robot)
    assert "first_moment =" not in text.replace("#first_moment =", "")
    path.write_text(text, "utf-8")
    before = pteron.load(path)
    path.write_text(text.replace("mass = 1.7600000000000002", "mass = 1.5"), "utf-8")
    after = pteron.load(path)
    centers = [np.array(robot.legs[0].upper.center_of_mass) for robot in (before, after)]
    assert np.allclose(*centers, rtol=0.0, atol=1e-12)
    assert after.legs[0].upper.mass == 1.5


def test_a_mass_edited_beside_its_first_moment_is_explained(tmp_path):
    """The advice was an inertia ten times as great, for a centre of mass 1.4 m off."""
    text = pteron.manipulator.saving.text_of(with_dimensions("delta", crank=0.2, rod=0.42))
    path = tmp_path / "robot.toml"
    path.write_text(text.replace("mass = 1.7600000000000002", "mass = 0.15"), "utf-8")
    _, errors = check(path, code=2)
    assert "puts the centre of mass at (1.376, 0.3168) m" in errors
    assert "Write center_of_mass, which stays, in place of first_moment" in errors
    assert "Then write" not in errors


def test_masses_of_the_template_are_named_again_until_they_are_edited(tmp_path):
    robot = with_dimensions("delta", base_radius=0.18, platform_radius=0.05, crank=0.2, rod=0.42)
    robot = replace(robot, name="my delta")
    assert template_sentence(robot) == (
        "Still as in delta: platform_mass 2.916 kg, upper 1.76 kg (its mass per length), lower "
        "0.418 kg (its mass per length); forces and torques depend on these masses and inertias; "
        "are they this machine's?"
    )
    path = pteron.save(robot, tmp_path / "robot.toml")
    assert check(path)[0]["template"] == template_sentence(robot)
    assert "Still as in delta" in CliRunner().invoke(app, ["cycle", str(path)]).stderr
    upper = type(robot.legs[0].upper).of_body(1.0, (0.1, 0.0), 0.02)
    legs = [replace(leg, upper=upper) for leg in robot.legs]
    assert template_sentence(replace(robot, legs=tuple(legs))) == ""


def test_links_of_144_kg_a_leg_under_40_kg_are_doubted(tmp_path):
    """Such were those of `pteron new stewart --limits 0.7:1`: a ram of 2.5 m in 0.7 m."""
    made = with_dimensions(
        "stewart", base_radius=0.6, platform_radius=0.4, limits=(0.7, 1.0), platform_mass=40.0
    )
    assert made.legs[0].upper.mass == pytest.approx(0.7 / 2.5 * 92.11067, rel=1e-6)
    assert made.legs[0].upper.center_of_mass[0] < 0.7
    long = TILTED["stewart"].legs[0]
    bodies = {
        key: replace(getattr(long, key), first_moment=(0.3 * sign * getattr(long, key).mass,))
        for key, sign in (("upper", 1.0), ("lower", -1.0))
    }
    robot = replace(made, legs=tuple(replace(leg, **bodies) for leg in made.legs))
    text = pteron.manipulator.saving.text_of(robot)
    path = tmp_path / "robot.toml"
    path.write_text(text, "utf-8")
    assert "92.1107 kg on 0.7 m, more than the platform's 40 kg: solid steel" in check(path)[1]


@pytest.mark.parametrize("seed", gated(range(6), {0}, CLIENTS))
def test_rams_between_figures_that_are_not_plane_stand_above_their_base(seed):
    """Both sides have poses, whose margins are no longer equal."""
    path = Path("robot.toml")
    path.write_text(machine_text("rams", seed), "utf-8")
    robot = pteron.load(path)
    radius = float(np.linalg.norm(robot.legs[0].platform_point))
    legs = []
    for i, leg in enumerate(robot.legs):
        down, up = -0.15 * radius * (1.0 + 0.5 * (i % 2)), 0.1 * radius * (i // 2)
        legs.append(
            replace(
                leg,
                platform_point=np.round(np.add(leg.platform_point, (0.0, 0.0, down)), 4),
                guide_point=np.round(np.add(leg.guide_point, (0.0, 0.0, up)), 4),
            )
        )
    both = home_poses(replace(robot, legs=tuple(legs)))
    assert both.mirror is not None
    assert both.mirror[2] < 0.0 < both.pose[2]


def test_no_message_suggests_other_dimensions_where_poses_are_in_reach():
    robot = pteron.load(BUILT / "short-cranks.toml")
    with pytest.raises(pteron.ModelError) as caught:
        pteron.random_poses(robot, 5, type_ii=0.99)
    assert not re.search("lengthen|nearer|widen", str(caught.value))


def test_the_page_of_verdicts_has_the_thresholds_as_they_are():
    """A threshold that changes is to change on the page, beside the sentence that explains it."""
    page = (Path(__file__).parents[1] / "docs" / "verdicts.md").read_text("utf-8")
    table = page[page.index("| words in the message |") :].split("\n\n")[0]
    rows = {row.split("|")[1].strip(): row.split("|")[3].strip() for row in table.splitlines()[2:]}
    shown = {
        "singular everywhere within": (
            "0.1 mm, or $L/1000$",
            (rounding_tolerance(1.0), rounding_tolerance(1e-3)) == (1e-4, 1e-6),
        ),
        "coordinates that differ by ... make the machine": (
            "ten times the previous threshold",
            INACCURATE == 10.0,
        ),
        "leg forces are up to": ("0.02", LEAST_SINGULAR_VALUE == 0.02),
        "to hold the weight": ("10", HOLDING_FORCE == 10.0),
        "near it a leg": ("100", HOLDING_FORCE_NEAR == 100.0),
        "their links cross": ("2 %", CROSSING == 0.02),
        "out of place": ("0.5 %", SAME_PLACE == 0.005),
        "more than the platform's": ("0.15", STOUT_LINK == 0.15),
    }
    for words, (value, same) in shown.items():
        (threshold,) = (text for key, text in rows.items() if key.startswith(words))
        assert threshold.startswith(value)
        assert same


def test_a_platform_whose_angle_slides_its_points_has_a_home():
    """No twist says how phi moves its points: its rows stand against the pose's rates."""
    robot = random_machine(0, "PRSSI")
    assert robot.platform.slides
    home = home_pose(robot)
    assert np.isfinite(pteron.inverse_kinematics(robot, home)).all()
    frame = row_frame(robot, home[None])
    distance = coordinate_distances(robot, home[None])[0]
    assert distance > 1e-4

    # The distance is what the slopes of the rows say, and a slope is that of a machine so changed.
    step = 1e-6 * frame.length
    leg = robot.legs[1]

    def unit_rows_with(change):
        point = (leg.platform_point[0] + change, *leg.platform_point[1:])
        legs = (robot.legs[0], replace(leg, platform_point=point), *robot.legs[2:])
        changed = replace(robot, legs=legs)
        return frame.normalise(pteron.jacobian(changed, home[None]))[0]

    slope = (unit_rows_with(step) - unit_rows_with(-step)) / (2.0 * step)
    u, sizes, v = np.linalg.svd(unit_rows(robot, home[None]).rows[0])
    one = abs(float(u[:, -1] @ slope[0] @ v[-1]))
    assert 0.0 < one < sizes[-1] / distance
