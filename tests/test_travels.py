"""Travel from a pose: proved, hardly shorter than by sampling and bisection, and what stops it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from commands import done, refused
from mechanisms import CATALOG, NIGHTLY, TILTED

import pteron
from pteron.errors import ModelError, PteronError
from pteron.kernels import numeric
from pteron.kernels.functions import TYPE_II
from pteron.workspace import conditions, home_pose, largest_box, prove, travel
from pteron.workspace.conditions import keeps

LOADED = CATALOG | TILTED
GATE = ["delta", "quadrupteron", "3-rrr", "wrist"]
MORE = ["stewart", "par4", "five-bar", "hexapteron", "agile-eye", "linear-delta", "pentapteron"]


def farthest(robot, pose, way, known):
    """Return how far a machine goes from a pose along a way, by samples and bisection."""
    required = conditions(robot)
    sign = np.sign(numeric(robot, "type_ii")(pose)[0])

    def serve(shares):
        poses = pose + shares[:, None] * way
        held = sign * numeric(robot, "type_ii")(poses)[0] > TYPE_II
        return np.asarray(keeps(robot, required, poses) & held)

    distances = np.linspace(0.0, 1.5 * known, 3001)
    good = serve(distances)
    if good.all():
        return np.inf
    first = int((~good).argmax())
    low, high = distances[max(first - 1, 0)], distances[first]
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if serve(np.array([middle]))[0] else (low, middle)
    return low


def compare(robot, pose):
    """Assert that the travels from a pose are those of bisection, at most 1 % shorter."""
    found = travel(robot, pose)
    for i in range(robot.freedom):
        for sign, distance in ((-1.0, -found.low[i]), (1.0, found.high[i])):
            if not np.isfinite(distance):
                continue
            true = farthest(robot, pose, sign * np.eye(robot.freedom)[i], distance + 1e-6)
            assert distance <= true * (1.0 + 1e-9) + 1e-12
            assert distance >= 0.99 * true - 1e-5


@pytest.mark.parametrize("name", [*GATE, *(pytest.param(name, marks=NIGHTLY) for name in MORE)])
def test_travel_is_that_of_bisection_and_never_beyond(name):
    robot = LOADED[name]
    compare(robot, home_pose(robot))
    for pose in pteron.random_poses(robot, 3, seed=1, type_i=0.1, type_ii=0.1):
        if keeps(robot, conditions(robot), pose):
            compare(robot, pose)


def test_what_stops_it_is_named():
    found = travel("delta", [0.0, 0.0, -0.9])
    assert [str(stop) for stop in found.stops[2]] == [
        "leg 1: crank at its least",
        "leg 2: crank at its most",
    ]
    rrr = travel("3-rrr", [0.0, 0.0, 0.0])
    assert str(rrr.stops[0][1]) == "near type II"
    rails = pteron.load("linear-delta")
    rails = replace(rails, legs=tuple(replace(leg, limits=None) for leg in rails.legs))
    found = travel(rails, home_pose(rails))
    assert np.isinf(found.high).tolist() == np.isinf(found.low).tolist() == [False, False, True]
    assert found.stops[2] == (None, None)
    with pytest.raises(ModelError, match="nothing stops it"):
        largest_box(rails, home_pose(rails))


def test_the_largest_box_is_proved_and_no_smaller_than_in_a_search_at_random():
    robot, pose = LOADED["quadrupteron"], np.zeros(4)
    box, found = largest_box(robot, pose), travel(robot, pose)
    assert prove(robot, box, type_ii=TYPE_II).holds
    assert box.low[3] == box.high[3] == 0.0
    required = conditions(robot, type_ii=TYPE_II)
    rng = np.random.default_rng(1)
    places = np.array(np.meshgrid(*[np.linspace(0.0, 1.0, 5)] * 3)).reshape(3, -1).T
    volumes = [0.0]
    for shares in rng.uniform(0.0, 1.0, (4000, 2, 3)):
        low, high = shares[0] * found.low[:3], shares[1] * found.high[:3]
        if np.prod(high - low) > volumes[-1]:
            poses = np.pad(low + places * (high - low), ((0, 0), (0, 1)))
            volumes += [np.prod(high - low)] if keeps(robot, required, poses).all() else []
    assert np.prod((box.box[1] - box.box[0])[:3]) >= max(volumes)


def test_the_command_says_how_far_and_what_stops_it():
    text = done("workspace delta --from 0,0,-0.9")
    assert "Proved travel along each coordinate" in text
    assert "leg 2: crank at its most" in text
    record = json.loads(done("workspace wrist --from 0,0,0 --json"))
    assert record["proved"]
    assert record["box"] is None
    assert record["travel"]["roll"]["high"] == pytest.approx(0.6, rel=1e-3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--from 0,0", "--from: 2 values given, 3 expected"),
        ("--from 0,0,0.9", "cannot be used: leg 1: crank"),
        ("--from 0,0,-0.9 --certify", "--certify: does not go with --from"),
        ("--from 0,0,-0.9 --points 5", "--points: does not go with --from"),
    ],
)
def test_nonsense_is_refused_in_a_line(options, message):
    assert message in refused(f"workspace delta {options}")


def test_a_pose_that_cannot_be_used_is_refused():
    with pytest.raises(PteronError, match=r"pose: .* cannot be used: leg"):
        travel("delta", [0.0, 0.0, 5.0])
