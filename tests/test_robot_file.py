"""`pteron new` and docs/robot-file.md: both say of every key what its declaration says."""

import json
import re
import runpy
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomlkit
from mechanisms import CATALOG, CLIENTS, gated
from pydantic import TypeAdapter

import pteron
from pteron import Manipulator, OutputError
from pteron.legs import KINDS
from pteron.manipulator import with_dimensions
from pteron.manipulator.commented_file import commented_text
from pteron.manipulator.crank_direction import crank_direction_text
from pteron.manipulator.leg_tables import leg_table
from pteron.manipulator.saving import document_of
from pteron.manipulator.tables import PlatformTable

DOCS = Path(__file__).parent.parent / "docs"
PAGE = (DOCS / "robot-file.md").read_text(encoding="utf-8")


@pytest.fixture
def program(tmp_path, monkeypatch):
    """Return what runs `pteron` in a folder of its own."""
    from typer.testing import CliRunner

    from pteron.cli.main import app

    monkeypatch.chdir(tmp_path)
    return lambda *words: CliRunner().invoke(app, list(words))


# pteron new.


@pytest.mark.parametrize("name", CATALOG)
def test_an_explained_file_is_that_machine_and_is_read_at_once(name, tmp_path):
    file = tmp_path / "robot.toml"
    file.write_text(commented_text(name), encoding="utf-8")
    robot, known = pteron.load(file), CATALOG[name]
    assert robot == Manipulator(f"my {name}", known.platform, known.legs, known.gravity)
    assert max(map(len, commented_text(name).splitlines())) <= 125


@pytest.mark.parametrize("name", ["quadrupteron", "delta-4", "linear-delta", "3-prr", "five-bar"])
def test_it_says_of_every_key_what_it_is(name):
    text = commented_text(name)
    legs = {leg.type: leg_table(type(leg)) for leg in CATALOG[name].legs}
    spoken = re.sub(r"\s+#? ?", " ", text)
    for model in (PlatformTable, *legs.values()):
        for key, field in model.model_fields.items():
            if key == "first_moment":
                continue  # told of bodies in general
            assert re.search(rf"(?m)^#?{key} = |^\[\[platform\.{key}\]\]", text), key
            if not re.search(rf"\[\[platform\.{key}\]\]", text):
                assert field.description in spoken, key
    # Only the first leg of a kind is explained.
    assert len(re.findall(r"(?m)^#?elbow = [^#\n]*# ", text)) == len(legs)


def test_what_may_be_left_out_has_a_value_that_could_stand_there():
    models = {"platform": PlatformTable, **{name: leg_table(kind) for name, kind in KINDS.items()}}
    for name, model in models.items():
        for key, field in model.model_fields.items():
            for example in field.examples or ():
                TypeAdapter(field.rebuild_annotation()).validate_python(example)
            told = field.is_required() or field.examples or field.default is not None
            assert told or key in ("first_moment", "center_of_mass"), (name, key)


@pytest.mark.parametrize("name", ["par4", "quadrupteron", "linear-delta", "delta-4", "3-prr"])
def test_what_a_leg_may_have_may_stand_there_as_it_is_written(name, tmp_path):
    head, first, *others = commented_text(name).split("[[legs]]")
    keys = re.findall(r"(?m)^#\w+ = ", first)
    assert keys
    for key in keys:
        file = tmp_path / "robot.toml"
        file.write_text("[[legs]]".join([head, first.replace(key, key[1:]), *others]))
        pteron.load(file)


def test_it_is_written_to_a_file_and_none_is_replaced_unasked(program):
    assert program("new", "delta", "--out", "robot.toml").exit_code == 0
    text = Path("robot.toml").read_text(encoding="utf-8")
    assert text == commented_text("delta") == program("new", "delta").stdout
    Path("robot.toml").write_text("mine")
    refused = program("new", "delta", "--out", "robot.toml")
    assert refused.exit_code == 2
    assert "robot.toml: is there already; name another file, or say --overwrite" in refused.stderr
    assert Path("robot.toml").read_text() == "mine"
    assert program("new", "delta", "--out", "robot.toml", "--overwrite").exit_code == 0
    assert Path("robot.toml").read_text(encoding="utf-8") == text
    assert [file.name for file in Path().iterdir()] == ["robot.toml"]
    assert "the file is valid; this machine can work." in program("check", "robot.toml").stdout


def test_without_a_kind_the_kinds_are_listed_and_an_unknown_one_is_guessed(program):
    assert program("new").stdout == program("catalog").stdout
    refused = program("new", "detla")
    assert refused.exit_code == 2
    assert 'did you mean "delta"?' in refused.stderr
    assert program("new", "delta", "--out", "no/where.toml").exit_code == 2


def test_a_file_of_one_s_own_is_explained_too(tmp_path):
    robot = CATALOG["quadrupteron"]
    file = pteron.save(robot, tmp_path / "plain.toml")
    again = tmp_path / "explained.toml"
    again.write_text(commented_text(file), encoding="utf-8")
    assert pteron.load(again).legs == robot.legs
    assert tomllib.loads(again.read_text())["name"] == "my quadrupteron"
    with pytest.raises(OutputError):
        pteron.save(robot, tmp_path / "no" / "where.toml")


@CLIENTS
def test_dimensions_are_what_a_file_written_by_hand_gives(program):
    given = [
        "--base-radius",
        "0.2",
        "--platform-radius",
        "0.06",
        "--crank",
        "0.25",
        "--rod",
        "0.55",
    ]
    stock = ["--mass-from", "aluminium-tube:30x2", "--mass-from", "lower=carbon-rod:8"]
    done = program("new", "delta", *given, *stock, "--limits", "-1:1.2", "--out", "robot.toml")
    assert done.exit_code == 0, done.output
    robot, like = pteron.load("robot.toml"), CATALOG["delta"]
    tube = 2700.0 * np.pi * (0.015**2 - 0.013**2) * 0.25
    rods = 2.0 * 1600.0 * np.pi * 0.004**2 * 0.55
    crank = tube * ((0.015**2 + 0.013**2) / 4.0 + 0.25**2 / 3.0)
    rod = rods * (0.004**2 / 4.0 + 0.55**2 / 3.0)
    for leg, old in zip(robot.legs, like.legs, strict=True):
        np.testing.assert_allclose(leg.guide_point, np.array(old.guide_point) * 0.2 / 0.33)
        np.testing.assert_allclose(leg.platform_point, np.array(old.platform_point) * 0.06 / 0.125)
        assert (leg.upper_length, leg.lower_length, leg.limits) == (0.25, 0.55, (-1.0, 1.2))
        np.testing.assert_allclose(leg.upper.values, [tube, tube * 0.125, 0.0, crank])
        np.testing.assert_allclose(leg.lower.values, [rods, -rods * 0.275, rod])
    assert program("check", "robot.toml").exit_code == 0


def bar(length, start, count, axes):
    """Return the body of steel rods of 10 mm from x = start of its frame."""
    mass, middle = count * 7850.0 * np.pi * 0.005**2 * length, start + length / 2.0
    about = mass * (0.005**2 / 4.0 + length**2 / 12.0 + middle**2)
    return {"mass": mass, "center_of_mass": [middle, 0.0][:axes], "inertia": about}


def leg_by_hand(name, azimuth, base, platform, crank, rod):
    """Return the table of a leg at an azimuth, rad."""
    c, s = float(np.cos(azimuth)), float(np.sin(azimuth))
    keys = {
        "guide_point": [base * c, base * s, 0.0],
        "platform_point": [platform * c, platform * s, 0.0],
        "lower_length": rod,
        "limits": [-2.0, 2.5],
    }
    if name == "3-rrr":
        keys |= {"type": "RRR", "direction": [0.0, 0.0, 1.0], "zero_direction": [1.0, 0.0, 0.0]}
        keys["lower"] = bar(rod, -rod, 1, 2)
    else:
        keys |= {"rods": 2, "lower": bar(rod, -rod, 2, 1)}
    if name == "linear-delta":
        keys |= {"type": "PSS", "slider_direction": [0.0, 0.0, 1.0], "elbow": -1}
        return keys | {"slider": {"mass": 0.12}, "bar_direction": [-s, c, 0.0]}
    if name == "delta":
        level, down = 0.9956794417434706, -0.09285714452539878
        keys |= {"type": "RSS", "direction": [s, -c, 0.0], "elbow": 1}
        keys["zero_direction"] = [level * c, level * s, down]
    return keys | {"upper_length": crank, "upper": bar(crank, 0.0, 1, 2)}


@pytest.mark.parametrize(
    ("name", "azimuths", "sizes"),
    [
        ("delta", (0, 120, 240), (0.25, 0.06, 0.28, 0.7)),
        ("linear-delta", (210, 330, 90), (0.25, 0.06, 0.0, 0.7)),
        ("3-rrr", (210, 330, 90), (0.25, 0.06, 0.2, 0.15)),
    ],
)
def test_new_machines_are_those_of_sines_and_cosines(program, name, azimuths, sizes):
    options = dict(zip(("base-radius", "platform-radius", "crank", "rod"), sizes, strict=True))
    given = [f"--{key}={size}" for key, size in options.items() if size]
    stock = "steel-rod:10" if sizes[2] else "lower=steel-rod:10"
    more = ["--limits=-2:2.5", f"--mass-from={stock}", "--out=new.toml"]
    assert program("new", name, *given, *more).exit_code == 0
    made = pteron.load("new.toml")
    legs = [leg_by_hand(name, np.radians(azimuth), *sizes) for azimuth in azimuths]
    hand = document_of(made) | {"legs": legs, "platform": document_of(CATALOG[name])["platform"]}
    Path("hand.toml").write_text(tomlkit.dumps(hand), encoding="utf-8")
    expected = pteron.load("hand.toml")
    for one, other in zip(made.legs, expected.legs, strict=True):
        assert (type(one), one.limits, one.elbow) == (type(other), other.limits, other.elbow)
        for key in one.metres:
            np.testing.assert_allclose(one.metres[key], other.metres[key], rtol=0, atol=1e-11)
    exact = {"rtol": 1e-10, "atol": 1e-12}
    np.testing.assert_allclose(pteron.parameters(made), pteron.parameters(expected), **exact)
    state = pteron.random_poses(expected, 3, seed=0), *np.ones((2, 3, made.freedom))
    forces = [pteron.inverse_dynamics(robot, *state) for robot in (made, expected)]
    np.testing.assert_allclose(*forces, rtol=1e-8)


def own_dimensions(robot, factor):
    """Return options of `new` with a machine's own dimensions times a factor."""
    points = np.array([leg.guide_point for leg in robot.legs])
    flat = np.eye(3) - np.outer(robot.platform.axis, robot.platform.axis)
    radius = np.linalg.norm((points - points.mean(axis=0)) @ flat, axis=1).max()
    found = ["--base-radius", f"{factor * radius:.9g}"] if radius > 1e-9 else []
    for option, key in (("--crank", "upper_length"), ("--rod", "lower_length")):
        lengths = [getattr(leg, key) for leg in robot.legs if hasattr(leg, key)]
        if lengths and min(lengths) == max(lengths):
            found += [option, f"{factor * lengths[0]:.9g}"]
    return found


@pytest.mark.parametrize("name", gated(pteron.catalog(), ["3-prr", "tripteron"]))
def test_new_machines_of_every_kind_pass_the_check(program, name):
    given = own_dimensions(pteron.load(name), 1.02)
    assert program("new", name, *given, "--out", "new.toml").exit_code == 0
    checked = program("check", "new.toml", "--json")
    assert checked.exit_code == 0, checked.output
    assert json.loads(checked.stdout)["home_reserve"] > 0.0


@pytest.mark.parametrize("name", ["par4", "stewart"])
def test_a_platform_of_another_mass_is_as_much_heavier_in_all(program, name):
    done = program("new", name, "--base-radius", "0.3", "--out", "new.toml")
    assert "platform_mass" in done.stdout
    assert "base_radius" not in done.stdout
    own = pteron.load(name).platform
    done = program(
        "new", name, "--platform-mass", "0.3", "--limits", "1.9:3.7", "--out", "light.toml"
    )
    assert ", upper" in done.stdout
    assert "limits 1.9" not in done.stdout
    assert "platform_mass" not in done.stdout
    light = pteron.load("light.toml").platform
    masses = [sum((one.inertia.mass, *(bar.mass for bar in one.bars))) for one in (own, light)]
    assert masses[1] == pytest.approx(0.3, rel=1e-9)
    factor = masses[1] / masses[0]
    expected = factor * np.array(own.inertia.values)
    np.testing.assert_allclose(light.inertia.values, expected, rtol=1e-9, atol=1e-15)


def test_what_a_new_machine_keeps_of_the_old_one_is_told(program):
    stock = "upper=steel-rod:10"
    done = program("new", "delta", "--crank", "0.2", "--mass-from", stock, "--out", "new.toml")
    told = " ".join(done.stdout.split())
    assert "lower 1.05 kg" in told
    assert "upper" not in told
    assert "crank_zero 5.33 deg below horizontal" in told
    assert crank_direction_text(pteron.load("new.toml")) == "5.33 deg below horizontal"


@pytest.mark.parametrize("name", sorted(set(CATALOG) - {"five-bar", "3-rrr-point"}))
def test_machines_have_radii(name):
    robot, platform = CATALOG[name], CATALOG[name].platform
    other = with_dimensions(robot, base_radius=0.4, platform_radius=0.1)
    flat = np.eye(3) - np.outer(platform.axis, platform.axis)
    points = np.array([leg.guide_point for leg in other.legs])
    ends = [leg.platform_point @ np.array(platform.frame) + leg.fixed_offset for leg in other.legs]
    for radius, across in ((0.4, (points - points.mean(axis=0)) @ flat), (0.1, ends @ flat)):
        assert np.linalg.norm(across, axis=1).max() == pytest.approx(radius, rel=1e-9)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (["five-bar", "--platform-radius", "0.1"], "platform_radius: the points are on one line"),
        (["stewart", "--crank", "0.2"], "crank: the legs of stewart have no such length"),
        (["delta", "--rod", "0"], "--rod: '0' given, a number above 0 in m"),
        (["delta", "--mass-from", "wood-rod:8"], "'wood-rod:8' is no stock"),
        (["delta", "--mass-from", "steel-tube:8x5"], "a wall of 5 mm is more than half of 8 mm"),
        (["delta", "--mass-from", "middle=steel-rod:8"], "middle: no link of delta"),
        (["delta", "--limits", "3"], "LOW:HIGH expected"),
    ],
)
def test_dimensions_that_cannot_be_are_told_in_a_line(program, given, told):
    refused = program("new", *given)
    assert refused.exit_code == 2
    assert told in refused.stderr
    assert refused.stderr.count("\n") == 1


# The page.


def test_the_page_has_the_keys_as_they_are_declared():
    script = runpy.run_path(str(DOCS / "pictures" / "keys.py"))
    assert script["filled"](PAGE) == PAGE, "run make docs"
    marked = set(re.findall(r"<!-- keys of (.*?) -->", PAGE))
    assert marked == set(script["TABLES"])


def test_every_kind_of_leg_is_drawn():
    """The pictures themselves are compared in test_documents.py."""
    script = runpy.run_path(str(DOCS / "pictures" / "legs.py"))
    assert set(script["DRAWINGS"]) == set(KINDS)
    for name in KINDS:
        assert f"](legs/{name}.svg)" in PAGE
