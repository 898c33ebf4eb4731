"""What a person meets at the prompt: completion, and robots by their name or path."""

import importlib
import inspect
import pkgutil
import rlcompleter
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import jedi
import numpy as np
import pandas as pd
import pytest
from mechanisms import CLIENTS

import pteron
from pteron.controllers import ComputedTorque
from pteron.errors import ModelError
from pteron.manipulator import as_manipulator

PACKAGES = [pteron.__name__] + [
    found.name
    for found in pkgutil.walk_packages(pteron.__path__, "pteron.")
    if found.ispkg and hasattr(importlib.import_module(found.name), "__all__")
]
PUBLIC = [
    "pteron",
    *(f"pteron.{name}" for name in pteron.__all__ if inspect.ismodule(getattr(pteron, name))),
    "pteron.dynamics",
]


def functions():
    """Return the public functions that take a robot, by name."""
    found = {}
    for module in PUBLIC:
        for name in dir(importlib.import_module(module)):
            value = getattr(importlib.import_module(module), name)
            if inspect.isroutine(value) and "robot" in inspect.signature(value).parameters:
                found[value] = f"{module}.{name}"
    return found


@pytest.mark.parametrize("package", PACKAGES)
def test_what_is_listed_is_what_is_public(package):
    module = importlib.import_module(package)
    more = {"__version__"} if package == "pteron" else set()
    assert set(dir(module)) == set(module.__all__) | more
    assert all(hasattr(module, name) for name in module.__all__)


def test_completion_shows_the_public_names_and_nothing_else():
    for module in PUBLIC:
        names = set(importlib.import_module(module).__all__)
        space = {"pteron": pteron}
        shown = {one.name for one in jedi.Interpreter(f"{module}.", [space]).complete()}
        assert shown - {"__version__"} == names
        plain = rlcompleter.Completer(space)
        plain.complete(f"{module}.", 0)
        assert {match.split(".")[-1].rstrip("()") for match in plain.matches} == names


def test_every_public_function_takes_a_robot_by_name():
    """A name that there is not is told by `load`, so whatever else is given is not looked at."""
    found = functions()
    assert len(found) > 90
    for function, name in found.items():
        signature = inspect.signature(function)
        needed = [p for p in signature.parameters.values() if p.default is p.empty]
        assert "RobotLike" in str(signature.parameters["robot"].annotation), name
        by_name = {p.name: None for p in needed if p.kind is not p.VAR_POSITIONAL}
        with pytest.raises(ModelError, match=r"^quadruptron: neither a file nor a machine of the"):
            inspect.unwrap(function)(**by_name | {"robot": "quadruptron"})


@CLIENTS
def test_a_name_serves_as_the_robot_does():
    robot, state = pteron.load("quadrupteron"), np.array([[0.01, -0.02, 0.03, 0.2]] * 3)
    rest = np.zeros(4)
    forces = pteron.inverse_dynamics("quadrupteron", state, rest, rest)
    assert (forces == pteron.inverse_dynamics(robot, state, rest, rest)).all()
    assert pteron.base_parameters("tripteron", "qr").rank == 16
    kernel = pteron.compile("delta", "jacobian")
    pose = [0.0, 0.0, -0.9]
    np.testing.assert_allclose(kernel(pose), pteron.jacobian("delta", pose), rtol=1e-13)
    assert ComputedTorque().law("tripteron").model == pteron.load("tripteron")
    motion = pteron.motion.pick_and_place("tripteron", np.zeros(3), samples=101)
    moved = pteron.motion.simulate("tripteron", motion, ComputedTorque(), model="tripteron")
    assert moved.robot == pteron.load("tripteron")


def test_a_pose_that_fails_is_told_of_a_robot_by_name_too():
    with pytest.raises(pteron.UnreachablePose, match=r"^pose: leg 1 misses it by"):
        pteron.inverse_kinematics("delta", [0.0, 0.0, -9.0])


def test_a_path_is_read_again_when_its_file_changes(tmp_path: Path):
    robot, rest = pteron.load("tripteron"), np.zeros(3)
    path = pteron.save(robot, tmp_path / "robot.toml")
    first = pteron.inverse_dynamics(path, rest, rest, rest)
    assert (first == pteron.inverse_dynamics(str(path), rest, rest, rest)).all()
    heavier = pteron.with_parameters(robot, 2.0 * pteron.parameters(robot))
    pteron.save(heavier, path)
    np.testing.assert_allclose(
        pteron.inverse_dynamics(path, rest, rest, rest), 2.0 * first, rtol=1e-14
    )
    assert as_manipulator(path) == heavier
    path.unlink()
    with pytest.raises(ModelError, match=r"robot\.toml: neither a file nor a machine"):
        pteron.inverse_dynamics(path, rest, rest, rest)


@pytest.mark.parametrize("wrong", [None, 1.0, ["delta"], {"name": "delta"}, b"delta"])
def test_what_is_no_robot_is_refused_in_a_line(wrong):
    zero = np.zeros(3)
    for call in (
        lambda: pteron.inverse_dynamics(wrong, zero, zero, zero),
        lambda: pteron.direct_kinematics(wrong, zero),
        lambda: pteron.compile(wrong, "jacobian"),
        lambda: pteron.save(wrong, "robot.toml"),
    ):
        message = f"robot: {type(wrong).__name__} given, a Manipulator expected, the name of one"
        with pytest.raises(ModelError, match=f"^{message}") as caught:
            call()
        assert "\n" not in str(caught.value)


class Balance(HTMLParser):
    """Refuses HTML whose elements do not close in order, or that fetches or runs anything."""

    def __init__(self, text):
        super().__init__()
        self.open = []
        self.cells = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        assert tag not in ("script", "link", "img")
        assert {name for name, _ in attributes} <= {"class"}
        self.open.append(tag)
        if tag == "tr":
            self.cells.append(0)
        if tag in ("td", "th"):
            self.cells[-1] += 1

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def values():
    """Return values of every kind that a notebook shows, by name."""
    driven = pteron.load("delta")
    drive = pteron.legs.Drive(coulomb=1.0, max_force=40.0, max_speed=10.0)
    legs = (*(replace(leg, drive=drive) for leg in driven.legs[:2]), driven.legs[2])
    motion = pteron.motion.pick_and_place("delta", [0.0, 0.0, -0.8], samples=21)
    run = pteron.motion.simulate("delta", motion, ComputedTorque(), duration=0.01)
    found = {name: pteron.load(name) for name in ("quadrupteron", "five-bar", "h4")}
    found |= {"driven": replace(driven, legs=legs), "<b>": replace(driven, name="a < b")}
    found |= {"base": pteron.base_parameters("delta", "qr"), "motion": motion, "run": run}
    return found | {"sizing": pteron.motion.size("delta", motion)}


def test_values_are_shown_as_a_short_line_and_as_a_table():
    for name, value in values().items():
        assert len(repr(value)) < 100, name
        assert repr(value).startswith("<"), name
        html = value._repr_html_()
        table = Balance(html)
        assert len(set(table.cells)) == 1, name
        assert len(table.cells) > 2, name
        assert len(html) < 8000, name
        assert "http" not in html, name


def test_the_table_says_what_the_value_does():
    shown = values()
    assert "<b>a &lt; b</b>" in shown["<b>"]._repr_html_()
    assert "up to 40 N m, 10 rad/s</td></tr>" in shown["driven"]._repr_html_()
    base = shown["base"]
    html = base._repr_html_()
    assert all(f">{text}</td>" in html for text in base.expressions("html"))
    assert repr(base) == "<BaseParameters of 'delta': 13 of 25, qr>"
    assert f"{base.values()[0]:.5g}" in html
    assert f"{shown['sizing'].peak_forces[0]:.4g} N m" in shown["sizing"]._repr_html_()
    assert repr(shown["run"]) == "<Simulation of 'delta': 0.01 s, 11 samples>"


def test_tables_of_forces_count_by_name_in_figures_and_simulations():
    time, order = np.linspace(0.0, 1.0, 5), ["torque3", "torque1", "torque2"]
    forces = pd.DataFrame(np.arange(15.0).reshape(5, 3), columns=order)
    figure = pteron.plots.forces_figure(time, forces, robot="delta")
    drawn = [line.get_ydata()[0] for line in figure.axes[0].lines[1:]]
    assert drawn == [1.0, 2.0, 0.0]
    home = [0.0, 0.0, -0.9]
    given = {"torque3": 3.0, "torque1": 1.0, "torque2": 2.0}
    runs = [
        pteron.motion.simulate("delta", forces=one, start=(home, [0.0, 0.0, 0.0]), duration=0.01)
        for one in (given, [1.0, 2.0, 3.0])
    ]
    assert (runs[0].pose == runs[1].pose).all()
