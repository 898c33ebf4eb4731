"""Files that belong to a machine know it: another one is refused, a calibrated one is named."""

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
import tomlkit

import pteron
from pteron.controllers import ComputedTorque, read_gains, write_gains
from pteron.errors import UnlikelyValue
from pteron.manipulator.machine_record import MOST_DIFFERENCE, expect_machine, machine_record

LAW = ComputedTorque(0.001, bandwidth=60.0)
_METRES = ("point", "offset", "length")


def with_leg(robot, i, **changes):
    """Return the machine with one leg changed, counted from 0."""
    legs = list(robot.legs)
    legs[i] = replace(legs[i], **changes)
    return replace(robot, legs=tuple(legs))


@pytest.fixture
def gains(tmp_path):
    """Return a file of gains of the catalog's Delta."""
    return write_gains("delta", LAW, tmp_path / "gains.toml")


def test_gains_are_taken_by_their_machine_without_a_word(gains):
    robot = pteron.load("delta")
    heavier = replace(robot, name="mine", gravity=(0.0, 0.0, -9.8))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for machine in (robot, heavier):
            np.testing.assert_array_equal(read_gains(machine, gains).gains(robot), LAW.gains(robot))


def test_gains_of_another_machine_are_refused_with_the_difference(gains):
    with pytest.raises(pteron.DataError, match=r"belongs to 'delta', .*RSS.*delta-omnid"):
        read_gains("delta-omnid", gains)
    other = pteron.load("delta").legs[0].lower_length
    changed = with_leg(pteron.load("delta"), 1, lower_length=1.02 * other)
    with pytest.raises(pteron.DataError, match=r"legs\[2\]\.lower_length .*1\.96% off"):
        read_gains(changed, gains)


def test_gains_of_another_topology_are_refused(tmp_path):
    """Joints of the same names; other legs, or elbows on the other side."""
    file = write_gains("linear-delta", LAW, tmp_path / "gains.toml")
    with pytest.raises(pteron.DataError, match="another topology"):
        read_gains("tripteron", file)
    robot = pteron.load("quadrupteron")
    file = write_gains(robot, LAW, tmp_path / "gains.toml")
    with pytest.raises(pteron.DataError, match=r"PRRR\+ PRRR\+ PRRR\+ PRRR\+.* PRRR-"):
        read_gains(with_leg(robot, 2, elbow=-1), file)


def test_gains_of_the_machine_before_its_calibration_are_taken_with_a_warning(gains):
    robot = pteron.load("delta")
    calibrated = with_leg(robot, 2, lower_length=robot.legs[2].lower_length * 1.001)
    with pytest.warns(UnlikelyValue, match=r"legs\[3\]\.lower_length .*0\.10% off"):
        read_gains(calibrated, gains)


def test_gains_of_earlier_versions_have_no_record(gains):
    text = gains.read_text(encoding="utf-8")
    gains.write_text(text[: text.index("[machine]")], encoding="utf-8")
    assert read_gains("delta-omnid", gains) is not None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data.update(machine=3), "machine: 3 given, a table expected"),
        (lambda data: data["machine"].pop("dimensions"), "dimensions: missing"),
        (lambda data: data["machine"].pop("topology"), "another topology"),
        (
            lambda data: data["machine"]["dimensions"].update({"legs[1].guide_point": [1.0]}),
            r"legs\[1\]\.guide_point: 3 numbers expected",
        ),
        (
            lambda data: data["machine"]["dimensions"].update(
                {"legs[1].guide_point": [float("nan")] * 3}
            ),
            r"legs\[1\]\.guide_point: 3 numbers expected",
        ),
    ],
)
def test_a_damaged_record_is_refused_in_one_line(gains, change, message):
    data = tomlkit.parse(gains.read_text(encoding="utf-8")).unwrap()
    change(data)
    if isinstance(data["machine"], dict):
        data["machine"]["geometry"] = "0"
    gains.write_text(tomlkit.dumps(data), encoding="utf-8")
    with pytest.raises(pteron.DataError, match=message) as refusal:
        read_gains("delta", gains)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("name", pteron.catalog())
def test_every_machine_is_known_from_toml_and_json(name, tmp_path):
    robot = pteron.load(name)
    record = machine_record(robot)
    again = pteron.load(pteron.save(robot, tmp_path / "robot.toml"))
    for data in (json.loads(json.dumps(record)), tomlkit.parse(tomlkit.dumps(record)).unwrap()):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            expect_machine(data, again, "file")
    others = [other for other in pteron.catalog() if other != name]
    for other in others:
        with pytest.raises(pteron.DataError, match="belongs to"):
            expect_machine(record, pteron.load(other), "file")


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_every_dimension_counts(share):
    """A change of each number alone is seen, and refused from the stated bound on."""
    robot = pteron.load("quadrupteron")
    record = machine_record(robot)
    lengths = {n: v for n, v in record["dimensions"].items() if n.rpartition("_")[2] in _METRES}
    size = max(np.linalg.norm(values) for values in lengths.values())
    for name, values in record["dimensions"].items():
        for k in range(len(values)):
            if "axis" in name or "direction" in name:
                scale = 1.0
            else:
                scale = values[0] if len(values) == 1 else size
            numbers = list(values)
            numbers[k] += share * MOST_DIFFERENCE * scale
            dimensions = {**record["dimensions"], name: numbers}
            changed = {**record, "geometry": "another", "dimensions": dimensions}
            words = name.replace("[", r"\[").replace("]", r"\]")
            if share > 1.0:
                with pytest.raises(pteron.DataError, match=words):
                    expect_machine(changed, robot, "file")
            else:
                with pytest.warns(UnlikelyValue, match=words):
                    expect_machine(changed, robot, "file")
