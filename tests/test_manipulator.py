"""Manipulators as values: their checks, their files, their parameters, and turning them."""

import datetime
import json
import os
import pickle
import re
from dataclasses import FrozenInstanceError, fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from mechanisms import CATALOG, MECHANISMS, random_machine
from scipy.spatial.transform import Rotation

import pteron
from pteron import Manipulator, ModelError, OutputError
from pteron.bodies import PlanarInertia
from pteron.legs import Leg
from pteron.manipulator import with_dimensions
from pteron.platforms import Platform

EVERY = pytest.mark.parametrize("name", MECHANISMS)
BODY = PlanarInertia(1.0, (0.0, 0.0), 1.0)
LEG = {
    "guide_point": (0.0, 0.0, 0.0),
    "direction": (0.0, 0.0, 1.0),
    "platform_point": (0.1, 0.0, 0.0),
    "upper_length": 0.2,
    "lower_length": 0.3,
    "slider_mass": 1.0,
    "upper": BODY,
    "lower": BODY,
}


def refused(call, *words, error=ModelError):
    """Check that a call raises, on one line, and that the message holds the words in order."""
    with pytest.raises(error, match=".*".join(re.escape(word) for word in words)) as caught:
        call()
    assert "\n" not in str(caught.value)
    assert isinstance(caught.value, pteron.PteronError)
    assert isinstance(caught.value, ValueError)


def message(call):
    with pytest.raises(ModelError) as caught:
        call()
    return str(caught.value)


# What a leg, an inertia, a platform and a manipulator refuse: the key, and what to do.

NOT_NUMBERS = {
    "nan": (np.nan, "is not a finite number"),
    "inf": (np.inf, "is not a finite number"),
    "digits": (10**400, "is too large a number"),
    "text": ("long", "is not a number"),
    "none": (None, "is not a number"),
    "list": ([1.0], "is not a number"),
}


@pytest.mark.parametrize("kind", NOT_NUMBERS)
@pytest.mark.parametrize("key", ["upper_length", "lower_length", "slider_mass"])
def test_a_leg_refuses_what_is_no_number(key, kind):
    value, words = NOT_NUMBERS[kind]
    shown = "slider.mass" if key == "slider_mass" else key
    refused(lambda: Leg(**{**LEG, key: value}), f"{shown}: ", words)


@pytest.mark.parametrize("value", [0.0, -0.0, -0.1])
@pytest.mark.parametrize(
    ("key", "shown", "unit"),
    [
        ("upper_length", "upper_length", "m"),
        ("lower_length", "lower_length", "m"),
        ("slider_mass", "slider.mass", "kg"),
    ],
)
def test_a_leg_refuses_what_is_not_positive(key, shown, unit, value):
    words = f"{shown}: {value:g} {unit} is not positive", f"give a value above 0 {unit}"
    refused(lambda: Leg(**{**LEG, key: value}), *words)


@pytest.mark.parametrize("key", ["guide_point", "direction", "platform_point", "slider_direction"])
def test_a_leg_refuses_what_is_no_vector(key):
    def leg(value):
        return lambda: Leg(**{**LEG, key: value})

    refused(leg((0.0, 1.0)), f"{key}: 2 numbers given, 3 expected")
    refused(leg((0.0, np.nan, 1.0)), f"{key}[1]: nan is not a finite number")
    refused(leg((0.0, 0.0, "x")), f"{key}[2]: 'x' is not a number")
    refused(leg(5.0), f"{key}: 5.0 is not a list of 3 numbers")


@pytest.mark.parametrize("key", ["direction", "slider_direction"])
def test_a_direction_must_have_unit_length(key):
    def leg(value):
        return Leg(**{**LEG, key: value})

    words = f"{key}: [0.0, 3.0, 4.0] has length 5, not 1", "write [0.0, 0.6, 0.8]"
    refused(lambda: leg((0.0, 3.0, 4.0)), *words)
    refused(lambda: leg((0.0, 0.0, 0.0)), f"{key}: ", "a zero vector has no direction")
    refused(lambda: leg((0.0, 0.0, 1.0 + 2e-6)), key, "not 1; write")
    # Digits of a file, short of the last ones, are made a unit vector.
    near = leg((0.0, 0.6 * (1 + 5e-7), 0.8 * (1 + 5e-7)))
    np.testing.assert_allclose(getattr(near, key), [0.0, 0.6, 0.8], rtol=0, atol=1e-16)


def test_a_slider_may_not_run_in_the_legs_plane():
    words = "slider_direction: ", "is perpendicular to direction", "tilt one against the other"
    refused(lambda: Leg(**LEG, slider_direction=(1.0, 0.0, 0.0)), *words)
    assert Leg(**LEG, slider_direction=(0.6, 0.0, -0.8)).e == (0.6, 0.0, -0.8)
    assert Leg(**LEG).e == LEG["direction"]


@pytest.mark.parametrize("elbow", [0, 2, -2, 0.5, "1", None])
def test_an_elbow_is_one_or_minus_one(elbow):
    refused(lambda: Leg(**LEG, elbow=elbow), f"elbow: {elbow!r} is neither 1 nor -1")


def test_limits_are_ordered():
    def leg(limits):
        return lambda: Leg(**LEG, limits=limits)

    words = "limits: ", "is not below", "give [least, most]"
    refused(leg((0.2, -0.1)), *words)
    refused(leg((0.1, 0.1)), *words)
    refused(leg((0.1,)), "limits: 1 numbers given, 2 expected")
    refused(leg((np.nan, 1.0)), "limits[0]: nan is not a finite number")
    assert leg((-1, 2))().limits == (-1.0, 2.0)


@pytest.mark.parametrize("rods", [0, -1, 1.5, True, "2"])
def test_rods_are_counted(rods):
    words = f"rods: {rods!r} is not a whole number of at least 1"
    refused(lambda: replace(CATALOG["delta"].legs[0], rods=rods), words)


@pytest.mark.parametrize("mass", [0.0, -1.0])
def test_a_body_has_mass(mass):
    words = f"mass: {mass:g} kg is not positive; give a value above 0 kg"
    refused(lambda: PlanarInertia(mass, (0.0, 0.0), 1.0), words)
    refused(lambda: PlanarInertia.of_body(mass, (0.0, 0.0), 1.0), words)


def test_an_inertia_belongs_to_a_real_body():
    words = "inertia: ", "belongs to no real body", "must be above 0.125 kg m^2"
    refused(lambda: PlanarInertia(2.0, (0.3, 0.4), 0.1249), *words)
    refused(lambda: PlanarInertia.of_body(2.0, (0.15, 0.2), 0.1249), *words)
    refused(lambda: PlanarInertia(1.0, (0.0, 0.0), 0.0), "inertia: 0", "belongs to no real body")
    refused(lambda: PlanarInertia(1.0, (0.0, 0.0), -1.0), "inertia: -1")
    refused(lambda: PlanarInertia(1.0, (0.0, 0.0), np.nan), "inertia: nan is not a finite number")
    refused(lambda: PlanarInertia(1.0, (0.0,), 1.0), "first_moment: 1 numbers given, 2 expected")
    refused(lambda: PlanarInertia(1.0, (0.0, np.inf), 1.0), "first_moment[1]: inf")
    refused(lambda: PlanarInertia.of_body(1.0, (np.nan, 0.0), 1.0), "center_of_mass[0]: nan")
    assert PlanarInertia(2.0, (0.3, 0.4), 0.125).inertia == 0.125, "a point mass is a body"


def test_an_inertia_gives_its_values_back():
    body = PlanarInertia.of_body(0.5, (0.2, -0.1), 0.1)
    assert body.values == (0.5, 0.1, -0.05, 0.1)
    assert body.center_of_mass == (0.2, -0.1)


def test_a_platform_has_a_motion_and_axes():
    def platform(motion="3T1R", **axes):
        return lambda: Platform(motion, BODY, **axes)

    refused(platform("4T"), "motion: '4T' given, '3T', '3T1R', '2T', '2T1R', '3T3R', '3T2R', '3R'")
    refused(platform(axis=(0.0, 2.0, 0.0)), "axis: [0.0, 2.0, 0.0] has length 2, not 1; write")
    words = "x_axis: missing; axis [0.0, 1.0, 0.0] is not the base frame's z", "must say"
    refused(platform(axis=(0.0, 1.0, 0.0)), *words)
    words = "x_axis: [0.0, 0.0, 1.0] is along axis [0.0, 0.0, 1.0]; give one at right angles to it"
    refused(platform(x_axis=(0.0, 0.0, 1.0)), words)
    words = "x_axis: [0.6, 0.0, 0.8] is not perpendicular to axis", "; [1.0, 0.0, 0.0] is"
    refused(platform(x_axis=(0.6, 0.0, 0.8)), *words)
    refused(platform("3T", limits=(-0.5, 0.5)), "limits: a 3T platform has no angle to limit")
    refused(platform(x_axis=(1.0, 0.0)), "x_axis: 2 numbers given, 3 expected")
    assert platform()().frame == ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    turned = platform(axis=(0.0, 1.0, 0.0), x_axis=(0.0, 0.0, 1.0))()
    assert turned.frame == ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert (platform()().coordinates, platform("3T")().coordinates) == (
        ("x", "y", "z", "phi"),
        ("x", "y", "z"),
    )


def test_an_x_axis_that_leans_by_rounding_is_set_upright():
    lean = 5e-7
    x = Platform("3T1R", BODY, x_axis=(np.cos(lean), 0.0, np.sin(lean))).x_axis
    assert x == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("name", CATALOG)
def test_a_manipulator_needs_a_leg_for_each_freedom(name):
    robot = CATALOG[name]
    n, motion = robot.freedom, robot.platform.motion
    words = f"{motion} platform has {n} freedoms and needs {n} legs or more"
    refused(lambda: replace(robot, legs=robot.legs[: n - 1]), f"legs: {n - 1} given, ", words)
    refused(lambda: replace(robot, legs=()), "legs: 0 given")


def test_a_manipulator_has_a_name_and_gravity():
    robot = CATALOG["tripteron"]
    refused(lambda: replace(robot, name="  "), "name: '  ' is not a text with at least one letter")
    words = "gravity: (0.0, 1.0) given, 3 values (each a number) expected"
    refused(lambda: replace(robot, gravity=(0.0, 1.0)), words, error=pteron.DataError)
    refused(lambda: replace(robot, gravity=(0.0, 0.0, np.nan)), "gravity[2]: nan is not a finite")
    assert Manipulator("t", robot.platform, list(robot.legs)).gravity == (0.0, 0.0, -9.81)


def with_directions(robot, *directions):
    legs = zip(robot.legs, directions, strict=True)
    return replace(robot, legs=tuple(replace(leg, direction=d) for leg, d in legs))


X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
TILTED = (0.0, 0.6, 0.8)


def test_constraints_that_leave_the_platform_a_freedom_are_refused():
    three, four = CATALOG["tripteron"], CATALOG["quadrupteron"]
    words = "free to turn about [0.0, 0.0, 1.0]: all directions are parallel to it; turn a leg's"
    refused(lambda: with_directions(three, Z, Z, (0.0, 0.0, -1.0)), words)
    words = "free to tilt about [0.0, 1.0, 0.0]: all directions lie in one plane with it and the"
    refused(lambda: with_directions(four, Y, Y, TILTED, TILTED), words)
    # A leg along k has no universal joint; two that are not parallel hold a 3T platform.
    assert with_directions(four, Z, Y, TILTED, TILTED).freedom == 4
    assert with_directions(four, X, Y, TILTED, TILTED).freedom == 4
    assert with_directions(three, Z, Z, X).freedom == 3


def test_values_are_frozen_and_hashable():
    robot = CATALOG["quadrupteron"]
    again = replace(robot, gravity=list(robot.gravity))
    assert again == robot
    assert hash(again) == hash(robot)
    for value in (robot, robot.legs[0], robot.platform, robot.legs[0].upper):
        with pytest.raises(FrozenInstanceError):
            setattr(value, fields(value)[0].name, 1.0)


# Files.


@EVERY
def test_a_saved_machine_is_loaded_without_loss(name, tmp_path):
    robot = MECHANISMS[name]
    file = pteron.save(robot, tmp_path / "robot.toml")
    assert file == tmp_path / "robot.toml"
    assert pteron.load(file) == robot
    assert pteron.load(str(file)) == robot
    text = file.read_text(encoding="utf-8")
    pteron.save(pteron.load(file), file)
    assert file.read_text(encoding="utf-8") == text
    assert [f.name for f in tmp_path.iterdir()] == ["robot.toml"]


def test_names_and_limits_survive_too(tmp_path):
    robot = CATALOG["tripteron"]
    legs = (replace(robot.legs[0], limits=None), *robot.legs[1:])
    robot = replace(robot, name='Mühle "3T" \\ # = 翼', legs=legs)
    assert pteron.load(pteron.save(robot, tmp_path / "a b.toml")) == robot


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("a\nb", r"name: has control characters \(U\+000A\), which files and messages"),
        ("\x1b[31m\x07\x01\x7f", r"\(U\+0001, U\+0007, U\+001B, ...\)"),
        ("a\u202eb", r"\(U\+202E\)"),
        ("a\u2028b", r"\(U\+2028\)"),
        ("a\ufffeb", r"\(U\+FFFE\)"),
        (201 * "a", "name: 201 characters given, at most 200 expected"),
    ],
)
def test_names_that_files_cannot_hold_are_refused(tmp_path, name, words):
    path = pteron.save(pteron.load("five-bar"), tmp_path / "robot.toml")
    given = "".join(c if c.isprintable() else f"\\u{ord(c):04X}" for c in name)
    path.write_text(path.read_text().replace('"five-bar"', f'"{given}"'))
    with pytest.raises(ModelError, match=words):
        pteron.load(path)
    with pytest.raises(ModelError, match=words) as refusal:
        replace(pteron.load("five-bar"), name=name)
    assert all(fault.isprintable() for fault in refusal.value.faults)
    with pytest.raises(ModelError, match=r"U\+D800"):
        replace(pteron.load("five-bar"), name="a\ud800b")


@pytest.mark.parametrize("name", [200 * "翼", "دلتا", "می\u200cرود", "नमस्ते", "a\u00a0b", "🦾"])
def test_names_of_every_script_are_kept(tmp_path, name):
    robot = replace(pteron.load("five-bar"), name=name)
    assert pteron.load(pteron.save(robot, tmp_path / "robot.toml")) == robot


@settings(deadline=None, derandomize=True, max_examples=25)
@given(st.integers(0, 10**6), st.sampled_from(["PPPP", "RPR"]))
def test_random_machines_are_loaded_without_loss(tmp_path_factory, seed, kinds):
    robot = random_machine(seed, kinds)
    assert pteron.load(pteron.save(robot, tmp_path_factory.mktemp("saved") / "r.toml")) == robot


@settings(deadline=None, derandomize=True, max_examples=25)
@given(st.sampled_from(sorted(MECHANISMS)), st.integers(0, 2**32 - 1))
def test_turned_machines_are_loaded_without_loss(tmp_path_factory, name, seed):
    robot = pteron.turned(MECHANISMS[name], Rotation.random(rng=seed).as_matrix())
    assert pteron.load(pteron.save(robot, tmp_path_factory.mktemp("saved") / "r.toml")) == robot


CATALOGUED = {
    "3-prr": ("2T1R", "PRR PRR PRR"),
    "3-rpr": ("2T1R", "RPR RPR RPR"),
    "3-rrr": ("2T1R", "RRR RRR RRR"),
    "3-rrr-point": ("2T", "RRR RRR RRR"),
    "delta-redundant": ("3T", "RSS RSS RSS RSS"),
    "delta": ("3T", "RSS RSS RSS"),
    "delta-4": ("3T1R", "RSS RSS RSS RUPU"),
    "delta-omnid": ("3T", "RSS RSS RSS"),
    "five-bar": ("2T", "RRR RRR"),
    "h4": ("3T1R", "RSS RSS RSS RSS"),
    "linear-delta": ("3T", "PSS PSS PSS"),
    "orthoglide": ("3T", "PSS PSS PSS"),
    "par4": ("3T1R", "RSS RSS RSS RSS"),
    "quadrupteron": ("3T1R", "PRRR PRRR PRRR PRRR"),
    "quadrupteron-oblique": ("3T1R", "PRRR PRRR PRRR PRRR"),
    "tripteron": ("3T", "PRRR PRRR PRRR"),
    "tripteron-colinear": ("3T", "PRRR PRRR PRRR"),
    "tripteron-oblique": ("3T", "PRRR PRRR PRRR"),
    "tripteron-router": ("3T", "PRRR PRRR PRRR"),
}


CATALOGUED |= {
    "ankle": ("2R", "RSS RSS"),
    "ankle-offset": ("2R", "RSS RSS"),
    "ball-table": ("1T2R", "RRS RRS RRS"),
    "hexa": ("3T3R", "RSS RSS RSS RSS RSS RSS"),
    "hexapteron": ("3T3R", "PRRS PRRS PRRS PRRS PRRS PRRS"),
    "pentapteron": ("3T2R", "PRUR PRUR PRUR PRUR PRUR"),
    "5-rpur": ("3T2R", "RPUR RPUR RPUR RPUR RPUR"),
    "agile-eye": ("3R", "SRRR SRRR SRRR"),
    "spherical-3-rrr": ("3R", "SRRR SRRR SRRR"),
    "3-upu": ("3T", "UPU UPU UPU"),
    "hexaglide": ("3T3R", "PSS PSS PSS PSS PSS PSS"),
    "reachy-mini": ("3T3R", "RSS RSS RSS RSS RSS RSS"),
    "rubin-camera-hexapod": ("3T3R", "UPS UPS UPS UPS UPS UPS"),
    "rubin-m2-hexapod": ("3T3R", "UPS UPS UPS UPS UPS UPS"),
    "sprint-z3": ("1T2R", "PRS PRS PRS"),
    "stewart": ("3T3R", "UPS UPS UPS UPS UPS UPS"),
    "wrist": ("3R", "UPS UPS UPS"),
}


def test_the_catalog():
    assert set(pteron.catalog()) == set(CATALOGUED)
    for name, (motion, types) in CATALOGUED.items():
        robot = pteron.load(name)
        assert robot.name == name
        assert robot.platform.motion == motion
        assert " ".join(leg.type for leg in robot.legs) == types
    for robot in CATALOG.values():
        assert pteron.random_poses(robot, 1, type_i=0.5, type_ii=0.05).shape == (1, robot.freedom)


def test_the_catalogs_quadrupteron_is_that_of_table_1():
    legs = CATALOG["quadrupteron"].legs
    assert [leg.direction for leg in legs] == [Z, Y, X, Y]
    assert [leg.platform_point for leg in legs] == [
        (0.0, -0.04, 0.0),
        (-0.04, 0.0, 0.0),
        (0.0, 0.04, 0.0),
        (0.04, 0.0, 0.0),
    ]
    lengths = [(leg.upper_length, leg.lower_length) for leg in legs]
    assert lengths == [(0.203, 0.223), (0.154, 0.161), (0.167, 0.167), (0.154, 0.161)]


def catalog_text(name):
    folder = Path(pteron.__file__).parent / "manipulator" / "catalog"
    return (folder / f"{name}.toml").read_text(encoding="utf-8")


CATALOG_TEXT = catalog_text("quadrupteron")


BAD_FILES = {
    "missing key": (
        "upper_length = 0.203\n",
        "",
        "leg 1: upper_length: missing; the file must give a number",
    ),
    "missing name": ('name = "quadrupteron"\n', "", "name: missing; the file must give a text"),
    "missing inertia": (", inertia = 0.003871914", "", "leg 3: upper.inertia: missing"),
    "missing motion": ('motion = "3T1R"\n', "", "platform.motion: missing"),
    "unknown key": (
        "mass = 0.8\n",
        "mass = 0.8\nmas = 1\n",
        "platform.mas: unknown key; did you mean mass? The valid ones there are motion, ",
    ),
    "unknown key of a link": (
        "mass = 0.36,",
        "mass = 0.36, kg = 1,",
        "leg 1: lower.kg: unknown key; ",
    ),
    "key of another kind": ("elbow = 1\n", "elbow = 1\nrods = 2\n", "leg 1: rods: unknown key; "),
    "text for a number": ("mass = 0.8", 'mass = "0.8"', "platform.mass: '0.8' given, a number"),
    "boolean for a number": ("mass = 0.8", "mass = true", "platform.mass: True given, a number"),
    "number for text": ('name = "quadrupteron"', "name = 3", "name: 3 given, a text expected"),
    "number for a vector": (
        "[0.0, -0.34, 0.0]",
        "0.34",
        "leg 1: guide_point: 0.34 given, a list of 3 numbers expected",
    ),
    "short vector": (
        "[0.0, -0.34, 0.0]",
        "[0.0, -0.34]",
        "leg 1: guide_point: [0.0, -0.34] given, a list of 3 numbers expected",
    ),
    "nan": ("mass = 0.8", "mass = nan", "platform.mass: nan given, a finite number expected"),
    "inf": (
        "[0.0, 0.0, -9.81]",
        "[0.0, 0.0, -inf]",
        "gravity, item 3: -inf given, a finite number",
    ),
    "unknown motion": (
        '"3T1R"',
        '"4T"',
        "platform.motion: '4T' given, '3T', '3T1R', '2T', '2T1R', '3T3R', '3T2R', '3R'",
    ),
    "unknown kind": (
        "elbow = 1\n",
        'elbow = 1\ntype = "RPX"\n',
        "leg 1: type: 'RPX' is not one of PRRR, PSS, RSS, RRR, PRR, RPR, RUPU",
    ),
    "elbow": ("elbow = 1", "elbow = 0", "leg 1: elbow: 0 given, 1 or -1 expected"),
    "not a unit vector": (
        "direction = [0.0, 0.0, 1.0]",
        "direction = [0.0, 0.0, 2.0]",
        "leg 1: direction: [0.0, 0.0, 2.0] has length 2, not 1; write [0.0, 0.0, 1.0]",
    ),
    "zero mass": ("mass = 0.8", "mass = 0", "platform.mass: 0 kg is not positive; give"),
    "zero mass of a slider": ("mass = 0.65", "mass = 0.0", "leg 3: slider.mass: 0 kg is not"),
    "negative length": (
        "upper_length = 0.203",
        "upper_length = -1",
        "leg 1: upper_length: -1 m is",
    ),
    "impossible inertia": (
        "inertia = 0.003871914",
        "inertia = 0.001",
        "leg 3: upper.inertia: 0.001 kg m^2 belongs to no real body",
    ),
    "limits": ("[-0.3, 0.3]", "[0.3, -0.3]", "leg 1: limits: 0.3 is not below -0.3; give"),
    "both": (
        "center_of_mass = [0.006, -0.004]",
        "center_of_mass = [0.006, -0.004]\nfirst_moment = [0.0, 0.0]",
        "platform.center_of_mass: both it and first_moment given; give one of the two",
    ),
    "neither": (
        "center_of_mass = [0.006, -0.004]",
        "",
        "platform.center_of_mass: neither it and first_moment given; give one of the two",
    ),
    "an axis without x_axis": (
        "axis = [0.0, 0.0, 1.0]",
        "axis = [0.0, 1.0, 0.0]",
        "platform.x_axis: missing",
    ),
    "empty name": ('"quadrupteron"', '" "', "name: ' ' is not a text with at least one letter"),
    "legs that are none": ("[platform]", "legs = 3\n[platform]", "not a TOML file"),
    "not TOML": ("mass = 0.8", "mass = = 0.8", "not a TOML file (Invalid value (at line 13"),
    "a decimal comma": (
        "mass = 0.8",
        "mass = 0,8",
        "not a TOML file (Expected newline or end of document after a statement (at line 13, "
        "column 9); 0,8 has a decimal comma, write a point)",
    ),
    "a key twice": ("mass = 0.8", "mass = 0.8\nmass = 0.8", "not a TOML file (Cannot overwrite"),
    "directions in a plane": (
        "direction = [0.0, 0.0, 1.0]",
        "direction = [0.0, 0.0, 1.0]\nslider_direction = [1.0, 0.0, 0.0]",
        "leg 1: slider_direction: [1.0, 0.0, 0.0] is perpendicular to direction",
    ),
}
BAD_DELTAS = {
    "zero direction along d": (
        "zero_direction = [0.9956794417434706, 0.0, -0.09285714452539878]",
        "zero_direction = [0.0, 1.0, 0.0]",
        "leg 1: zero_direction: [0.0, 1.0, 0.0] is along direction [0.0, -1.0, 0.0]; give one",
    ),
    "a rod off its axis": (
        "center_of_mass = [-0.5275]",
        "center_of_mass = [-0.5275, 0.0]",
        "leg 1: lower.center_of_mass: [-0.5275, 0.0] given, a list of 1 number expected: a rod has "
        "x only",
    ),
    "no rods": ("rods = 2", "rods = 0", "leg 1: rods: 0 given, a number of at least 1 expected"),
    "a slider": (
        "elbow = 1\n",
        "elbow = 1\nslider = { mass = 1.0 }\n",
        "leg 1: slider: unknown key",
    ),
    "single rods": (
        "rods = 2",
        "rods = 1",
        "legs: the platform is free to turn about several axes: legs 1, 2 and 3 keep it from no",
    ),
}
DELTA_TEXT = catalog_text("delta")


@pytest.mark.parametrize(
    ("text", "case"),
    [
        *(pytest.param(CATALOG_TEXT, case, id=name) for name, case in BAD_FILES.items()),
        *(pytest.param(DELTA_TEXT, case, id=name) for name, case in BAD_DELTAS.items()),
    ],
)
def test_a_bad_file_is_refused_with_the_key(text, case, tmp_path):
    old, new, words = case
    assert old in text
    file = tmp_path / "bad.toml"
    count = -1 if old == "rods = 2" and "1" in new else 1
    file.write_text(text.replace(old, new, count), encoding="utf-8")
    refused(lambda: pteron.load(file), f"{file}: {words}")


def test_a_file_whose_legs_leave_a_freedom_is_refused(tmp_path):
    text = CATALOG_TEXT.replace("direction = [1.0, 0.0, 0.0]", "direction = [0.0, 1.0, 0.0]")
    text = text.replace("direction = [0.0, 0.0, 1.0]", "direction = [0.0, 0.6, 0.8]")
    file = tmp_path / "bad.toml"
    file.write_text(text, encoding="utf-8")
    refused(lambda: pteron.load(file), f"{file}: legs: the platform is free to tilt about")


def test_all_faults_of_a_file_are_told_at_once(tmp_path):
    text = CATALOG_TEXT.replace("mass = 0.8", "mas = 0.8").replace("gravity =", "gravitation =")
    text = text.replace("upper_length = 0.203\n", "").replace("elbow = 1\n", "elbow = 2\n", 1)
    text = text.replace("mass = 0.65", "mass = -0.65")
    file = tmp_path / "bad.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ModelError) as caught:
        pteron.load(file)
    head, *lines = str(caught.value).split("\n")
    assert head == f"{file}: 5 faults"
    keys = ["platform.mas", "gravitation", "leg 1", "leg 1", "leg 3"]
    assert [line.strip().split(": ")[0] for line in lines] == keys
    assert lines[-1] == "  leg 3: slider.mass: -0.65 kg is not positive; give a value above 0 kg"


def test_files_of_version_0_1_are_read(tmp_path):
    """A leg's limits were `slider_limits`, and there was one kind of leg."""
    old = CATALOG_TEXT.replace("\nlimits", "\nslider_limits")
    assert old != CATALOG_TEXT
    assert "type" not in old
    file = tmp_path / "old.toml"
    file.write_text(old, encoding="utf-8")
    assert pteron.load(file) == CATALOG["quadrupteron"]
    both = old.replace("slider_limits =", "limits = [-0.3, 0.3]\nslider_limits =", 1)
    file.write_text(both, encoding="utf-8")
    refused(lambda: pteron.load(file), f"{file}: leg 1: slider_limits: the former name of limits")


HOSTILE = {
    "an integer of 5000 digits": (
        "mass = 0.8",
        "mass = " + "9" * 5000,
        "a number in it has thousands",
    ),
    "1000 nested brackets": (
        "mass = 0.8",
        "mass = " + "[" * 1000 + "]" * 1000,
        "nested too deeply",
    ),
    "1000 nested tables": ("mass = 0.8", "mass = " + "{a=" * 1000 + "1" + "}" * 1000, "nested too"),
    "a key of 20000 parts": ("mass = 0.8", ".".join("a" * 20000) + " = 1", "has over 16 parts"),
    "a text of 10 MB": ("mass = 0.8", f'mass = "{"x" * 10**7}"', "platform.mass: 'xxx"),
    "escape codes": ("mass = 0.8", 'mass = "\\u001b[31m"', r"platform.mass: '\x1b[31m' given"),
}


@pytest.mark.timeout(20)
@pytest.mark.parametrize("case", HOSTILE)
def test_a_file_meant_to_harm_is_refused_at_once_in_one_line(case, tmp_path):
    old, new, words = HOSTILE[case]
    file = tmp_path / "bad.toml"
    file.write_text(CATALOG_TEXT.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ModelError) as caught:
        pteron.load(file)
    assert words in str(caught.value)
    assert len(str(caught.value)) < 500
    assert str(caught.value).isprintable()


def test_a_byte_order_mark_is_passed_over(tmp_path):
    file = tmp_path / "marked.toml"
    file.write_text(CATALOG_TEXT, encoding="utf-8-sig")
    assert pteron.load(file) == CATALOG["quadrupteron"]


HEXAPODS = ("rubin-camera-hexapod", "rubin-m2-hexapod", "stewart")


def test_a_missing_file_is_told_by_the_file_beside_it_that_may_be_meant(tmp_path):
    (tmp_path / "robot.toml").write_text(CATALOG_TEXT, encoding="utf-8")
    near, missing = tmp_path / "robot.toml", tmp_path / "robto.toml"
    catalog = "neither a file nor a machine of the catalog"
    refused(lambda: pteron.load(missing), f'{missing}: {catalog}; did you mean "{near}"?')
    (tmp_path / "delat.toml").write_text(CATALOG_TEXT, encoding="utf-8")
    both = f'did you mean "{tmp_path / "delat.toml"}" or "delta"?'
    refused(lambda: pteron.load(tmp_path / "delta.toml"), both)
    refused(lambda: pteron.load(tmp_path / "nowhere.toml"), f"{catalog} (3-prr, ")


def test_files_that_cannot_be_read_are_refused(tmp_path):
    missing = tmp_path / "nowhere.toml"
    words = "neither a file nor a machine of the catalog (3-prr, 3-rpr, 3-rrr, 3-rrr-point, 3-upu, "
    refused(lambda: pteron.load(missing), f"{missing}: {words}")
    refused(lambda: pteron.load("quadrupteorn"), 'did you mean "quadrupteron"?')
    refused(lambda: pteron.load("delta.toml"), 'did you mean "delta"?')
    hexapods = " or ".join(f'"{name}"' for name in HEXAPODS)
    refused(lambda: pteron.load("hexapod"), f"did you mean {hexapods}?")
    refused(lambda: pteron.load(tmp_path), f"{tmp_path}: cannot be read")
    binary = tmp_path / "binary.toml"
    binary.write_bytes(bytes(range(256)))
    refused(lambda: pteron.load(binary), f"{binary}: not a TOML file (it is not UTF-8 text)")
    empty = tmp_path / "empty.toml"
    empty.write_bytes(b"")
    assert "3 faults" in message(lambda: pteron.load(empty))
    nul = tmp_path / "nul.toml"
    nul.write_bytes(b'name = "a\0b"\n')
    refused(lambda: pteron.load(nul), f"{nul}: not a TOML file")


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("", id="empty"),
        pytest.param("a\0b", id="nul"),
        pytest.param("x" * 5000, id="long"),
    ],
)
def test_a_name_that_can_be_no_file_is_refused(name):
    refused(lambda: pteron.load(name), ": ")


def test_saving_to_an_unwritable_place_leaves_nothing(tmp_path):
    robot = CATALOG["tripteron"]
    folder = tmp_path / "folder"
    folder.mkdir()
    (tmp_path / "file").write_text("kept")
    for place in (tmp_path / "no" / "such.toml", folder, tmp_path / "file" / "robot.toml"):
        words = f"{place}: cannot be written ("
        refused(lambda place=place: pteron.save(robot, place), words, error=OutputError)
    assert sorted(f.name for f in tmp_path.rglob("*")) == ["file", "folder"]
    assert (tmp_path / "file").read_text() == "kept"


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_a_saved_file_has_the_usual_permissions(tmp_path):
    plain = tmp_path / "plain"
    plain.touch()
    saved = pteron.save(CATALOG["tripteron"], tmp_path / "robot.toml")
    assert saved.stat().st_mode == plain.stat().st_mode


# Parameters.


@EVERY
def test_parameters_stand_in_the_papers_order(name):
    robot = MECHANISMS[name]
    expected = {}
    for letter in "pul":
        for i, leg in enumerate(robot.legs, start=1):
            key = {"p": "slider_mass", "u": "upper", "l": "lower"}[letter]
            body = getattr(leg, key, None)
            if body is None:
                continue
            if letter == "p":
                expected |= {f"m_p{i}": body}
                continue
            moments = dict(zip(("mgx", "mgy"), body.first_moment, strict=False))
            values = {"m": body.mass, **moments, "I": body.inertia}
            expected |= {f"{kind}_{letter}{i}": value for kind, value in values.items()}
    body = robot.platform.total_inertia
    platform = body.mass, *body.first_moment, body.inertia
    expected |= zip(("m_e", "mgx_e", "mgy_e", "I_e"), platform, strict=True)
    assert pteron.parameter_names(robot) == tuple(expected)
    assert pteron.parameters(robot).tolist() == list(expected.values())
    listed = pteron.manipulator.parameter_data(robot)
    assert tuple(p.name for p in listed) == tuple(expected)
    units = {"m": "kg", "mgx": "kg m", "mgy": "kg m", "I": "kg m^2"}
    assert pteron.manipulator.parameter_units(robot) == tuple(units[p.kind] for p in listed)
    for p in listed:
        assert p.name == f"{p.kind}_{p.body}{p.suffix}"
        assert p.length_power == {"kg": 0, "kg m": 1, "kg m^2": 2}[p.unit]
    counts = {"PRRR": 9, "PSS": 4, "RSS": 7, "RRR": 8, "PRR": 5, "RUPU": 6}
    assert len(expected) == sum(counts[leg.type] for leg in robot.legs) + 4


@EVERY
def test_with_parameters_gives_the_same_machine_back(name):
    robot = MECHANISMS[name]
    # Parameters tell the platform as a whole, not its bars and geared parts.
    whole = replace(robot, platform=robot.platform.with_total_inertia(robot.platform.total_inertia))
    values = pteron.parameters(robot)
    assert pteron.with_parameters(robot, values) == whole
    doubled = pteron.with_parameters(robot, 2 * values)
    assert doubled != whole
    np.testing.assert_array_equal(pteron.parameters(doubled), 2 * values)
    assert pteron.with_parameters(doubled, values.tolist()) == whole


def test_parameters_of_no_real_body_are_refused():
    robot = CATALOG["quadrupteron"]
    names = pteron.parameter_names(robot)

    def changed(name, value):
        values = pteron.parameters(robot)
        values[names.index(name)] = value
        return lambda: pteron.with_parameters(robot, values)

    refused(changed("m_p3", -1.0), "parameters of body p3: mass: -1 kg is not positive")
    refused(changed("m_u2", 0.0), "parameters of body u2: mass: 0 kg is not positive")
    refused(changed("I_l4", 1e-9), "parameters of body l4: inertia: 1e-09 kg m^2 belongs to no")
    refused(changed("mgx_e", 9.0), "parameters of body e: inertia: ", "belongs to no real body")
    refused(changed("mgy_u1", np.nan), "parameters of body u1: first_moment[1]: nan")
    words = "parameters: shape (39,) given, (40,) expected"
    refused(lambda: pteron.with_parameters(robot, np.ones(39)), words)
    refused(lambda: pteron.with_parameters(robot, np.ones((1, 40))), "parameters: shape (1, 40)")
    words = "values: 'heavy' given, real numbers expected"
    refused(lambda: pteron.with_parameters(robot, "heavy"), words, error=pteron.DataError)
    masked = np.ma.masked_array(pteron.parameters(robot), mask=np.arange(40) == 5)
    refused(lambda: pteron.with_parameters(robot, masked), "body u1: first_moment[0]: nan is not")


# Turning.


@EVERY
def test_turning_keeps_every_angle_and_length(name):
    robot = MECHANISMS[name]
    rotation = Rotation.random(rng=4).as_matrix()
    moved = pteron.turned(robot, rotation)

    base = (
        *("guide_point", "fixed_offset"),
        *("direction", "slider_direction", "zero_direction", "bar_direction"),
    )

    def vectors(machine):
        found = [machine.gravity, *machine.platform.frame]
        for leg in machine.legs:
            found += [getattr(leg, key) for key in base if getattr(leg, key, None) is not None]
        return np.array(found)

    np.testing.assert_allclose(vectors(moved), vectors(robot) @ rotation.T, atol=1e-14)
    for before, after in zip(robot.legs, moved.legs, strict=True):
        for key, value in vars(before).items():
            assert (getattr(after, key) == value) or key in base
        assert len(vars(after)) == len(vars(before))
    assert moved.name == robot.name
    assert moved.platform.inertia == robot.platform.inertia


def test_turning_back_gives_the_machine_back():
    robot = CATALOG["quadrupteron"]
    assert pteron.turned(robot, np.eye(3)) == robot
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert pteron.turned(pteron.turned(robot, quarter), quarter.T) == robot
    assert pteron.turned(robot, quarter, gravity=False).gravity == robot.gravity


def test_what_is_no_rotation_is_refused():
    robot = CATALOG["quadrupteron"]
    words = "rotation: not an orthogonal 3x3 matrix"
    refused(lambda: pteron.turned(robot, 2 * np.eye(3)), words)
    refused(lambda: pteron.turned(robot, np.eye(2)), words)
    refused(lambda: pteron.turned(robot, np.full((3, 3), np.nan)), words)
    words = "rotation: 'over' given, real numbers expected"
    refused(lambda: pteron.turned(robot, "over"), words, error=pteron.DataError)
    words = "rotation: the matrix is a reflection (determinant -1); negate one column"
    refused(lambda: pteron.turned(robot, np.diag([1, 1, -1])), words)


# Machines as text and as dictionaries.


@pytest.mark.parametrize("name", sorted(CATALOG))
def test_a_machine_goes_through_text_and_dictionary_without_loss(name):
    robot = pteron.load(name)
    assert pteron.manipulator.loads(pteron.manipulator.dumps(robot)) == robot
    assert (
        pteron.manipulator.from_dict(json.loads(json.dumps(pteron.manipulator.to_dict(robot))))
        == robot
    )


OWNER = {
    "serial": "Q-07",
    "calibrated": datetime.date(2026, 3, 1),
    "sensors": [{"place": [0.1, 0.2], "works": True}],
    "firmware": {"version": 3},
}


def test_data_of_the_owner_stay_with_the_machine_and_do_not_count(tmp_path):
    robot = pteron.load("delta")
    owned = replace(robot, owner=OWNER)
    assert owned == robot
    assert hash(owned) == hash(robot)
    for copy in (
        pteron.manipulator.loads(pteron.manipulator.dumps(owned)),
        pteron.load(pteron.save(owned, tmp_path / "owned.toml")),
        pickle.loads(pickle.dumps(owned)),
        with_dimensions(owned, rod=1.0),
        pteron.with_parameters(owned, pteron.parameters(owned)),
    ):
        assert dict(copy.owner) == OWNER
    owned.owner["sensors"].clear()
    assert dict(owned.owner) == OWNER
    assert dict(robot.owner) == {}


def test_data_of_the_owner_that_no_file_can_hold_are_named():
    with pytest.raises(ModelError) as raised:
        replace(pteron.load("delta"), owner={"a": None, "b": [{"c": object()}], 1: 2})
    assert str(raised.value) == (
        "3 faults\n"
        "  owner.a: NoneType given; a string, number, boolean, date, list or table expected\n"
        "  owner.b, item 1.c: object given; a string, number, boolean, date, list or table "
        "expected\n"
        "  owner: the key 1 given, a string expected"
    )


@pytest.mark.parametrize(
    ("read", "words"),
    [
        (lambda: pteron.manipulator.loads("a = "), "the text: "),
        (lambda: pteron.manipulator.loads("name = 'x'"), "platform: missing"),
        (lambda: pteron.manipulator.from_dict({"name": "x"}), "the tables: 2 faults"),
        (
            lambda: pteron.manipulator.from_dict({"owner": 3}),
            "owner: 3 given, a table expected: [owner]\n",
        ),
    ],
)
def test_a_text_or_dictionary_that_is_no_machine_has_its_faults_named(read, words):
    with pytest.raises(ModelError, match=re.escape(words)):
        read()
