"""Arguments that recur have one type, one default and one meaning in all public functions."""

import inspect
from collections import Counter
from functools import cache
from importlib import import_module
from pkgutil import iter_modules

import numpy as np
import pytest

import pteron
from pteron.calibration import Measurements, calibrate
from pteron.controllers import FeedForwardPD
from pteron.motion import pick_and_place, simulate, tune
from pteron.progress import Share

HINTS = {"progress": ("Progress | None",), "seed": ("Seed", "Seed | np.random.Generator")}
DEFAULTS = {"progress": None, "seed": 0, "on_failure": "raise"}
FILES = {"search"}
"""Functions whose seed is that of a file by default."""


@cache
def public_functions():
    """Return all public functions by their names."""
    packages = [f"pteron.{m.name}" for m in iter_modules(pteron.__path__) if m.ispkg]
    functions = {}
    for name in ["pteron", *packages]:
        if name in ("pteron.environments", "pteron.cli", "pteron.__pyinstaller"):
            continue
        package = import_module(name)
        for public in getattr(package, "__all__", ()):
            value = inspect.unwrap(getattr(package, public))
            if inspect.isfunction(value):
                functions[f"{name}.{public}"] = value
    return functions


@pytest.mark.parametrize("argument", ["progress", "seed", "on_failure"])
def test_an_argument_that_recurs_has_one_type_and_one_default(argument):
    seen = Counter()
    for name, function in public_functions().items():
        parameter = inspect.signature(function).parameters.get(argument)
        if parameter is None or name.rpartition(".")[2] in FILES:
            continue
        seen[name] += 1
        hints = HINTS.get(argument, ("OnFailure",))
        assert parameter.annotation in hints, (name, parameter.annotation)
        assert parameter.default == DEFAULTS[argument], (name, parameter.default)
    assert len(seen) >= 5


def work_on_a_delta():
    """Return long work by name: each takes a callable of progress."""
    robot = pteron.load("linear-delta")
    motion = pick_and_place(robot)
    law = FeedForwardPD(bandwidth=20.0, period=2e-4)
    poses = pteron.random_poses(robot, 40)
    readings = pteron.inverse_kinematics(robot, poses) + np.array([0.001, 0.0, 0.0])
    measured = Measurements.from_readings(robot, readings, poses=poses)
    return {
        "simulate": lambda tell: simulate(robot, motion, law, progress=tell),
        "tune": lambda tell: tune(robot, motion, progress=tell),
        "calibrate": lambda tell: calibrate(robot, measured, free=["zeros"], progress=tell),
    }


@pytest.mark.parametrize("name", ["simulate", "tune", "calibrate"])
def test_progress_takes_shares_that_rise_to_all(name):
    shares = []
    work_on_a_delta()[name](shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert len(shares) > 3
    assert all(isinstance(share, float) for share in shares)


def test_a_share_is_a_number_with_a_step():
    share = Share(0.25, "Reading")
    assert (share, share.step) == (0.25, "Reading")
    assert f"{share:.0%}" == "25%"
    assert (Share(1.2), Share(-0.1)) == (1.0, 0.0)


@pytest.mark.parametrize("seed", [0, 7, None])
def test_none_is_another_seed_each_time(seed):
    first, second = (pteron.random_poses("delta", 5, seed=seed) for _ in range(2))
    assert np.array_equal(first, second) == (seed is not None)
    assert pteron.base_parameters("tripteron", seed=seed).rank == 16
