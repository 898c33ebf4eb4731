"""The Gymnasium environments: Gymnasium's own checks, and the machine's physics under them."""

import subprocess
import sys
from dataclasses import replace
from functools import lru_cache

import gymnasium
import numpy as np
import pytest
from driven_machines import driven
from gymnasium.utils.env_checker import check_env
from mechanisms import (
    CATALOG,
    CLIENTS,
    NIGHTLY,
    TILTED,
    gated,
    in_turn,
    random_machine,
    with_elbows,
)
from scipy.integrate import solve_ivp

import pteron
from pteron.environments import REACH, PteronEnv, PteronVectorEnv
from pteron.extras import install_command
from pteron.motion import Motion, pick_and_place

MACHINES = {
    **{name: CATALOG[name] for name in ("quadrupteron", "delta-4", "five-bar")},
    "another mode": with_elbows(CATALOG["tripteron"], "+-+"),
    "mixed, driven": driven(random_machine(0, "PRS"), max_force=60.0),
    "planar": random_machine(0, "CLP"),
    **{name: TILTED[name] for name in ("wrist", "ball-table", "stewart")},
}
EVERY = in_turn(
    MACHINES, [name for name in MACHINES if name not in ("ball-table", "stewart")], share=3
)


@lru_cache
def env_of(name):
    return gymnasium.make(REACH, robot=MACHINES[name])


def start(name, seed=0, **options):
    env = env_of(name).unwrapped
    env.reset(seed=seed, options=options)
    return env


@EVERY
def test_gymnasiums_own_check_passes_without_a_warning(name):
    check_env(env_of(name).unwrapped, skip_render_check=True, skip_close_check=True)


def test_gymnasiums_whole_check_passes_with_pictures_and_a_name():
    check_env(gymnasium.make(REACH, robot="five-bar", render_mode="rgb_array").unwrapped)


@lru_cache
def moved(name):
    """Return a motion about the machine's home that ends where it begins."""
    world = env_of(name).unwrapped.world
    return pick_and_place(world.robot, world.home, scale=0.1, duration=0.6)


@CLIENTS
@pytest.mark.parametrize(
    ("name", "follow"),
    [
        ("delta-4", False),
        ("five-bar", True),
        pytest.param("delta-4", True, marks=NIGHTLY),
        pytest.param("five-bar", False, marks=NIGHTLY),
    ],
)
def test_many_environments_are_the_single_ones_step_for_step(name, follow):
    robot, motion = MACHINES[name], moved(name) if follow else None
    singles = gymnasium.vector.SyncVectorEnv(
        [
            lambda: gymnasium.make(REACH, robot=robot, motion=motion, max_episode_steps=25)
            for _ in range(3)
        ]
    )
    many = gymnasium.make_vec(REACH, num_envs=3, robot=robot, motion=motion, max_episode_steps=25)
    assert many.metadata["autoreset_mode"] == singles.metadata["autoreset_mode"]
    assert many.observation_space == singles.observation_space
    assert many.action_space == singles.action_space
    many.action_space.seed(7)
    first, second = many.reset(seed=3), singles.reset(seed=3)
    ended, late, reasons = 0, 0, set()
    for k in range(80):
        if k:
            # Soft enough for some episodes to last.
            actions = np.float32(0.2 if k % 2 else 0.05) * many.action_space.sample()
            first, second = many.step(actions), singles.step(actions)
            for one, other in zip(first[1:4], second[1:4], strict=True):
                np.testing.assert_array_equal(one, other)
            ended, late = ended + first[2].sum(), late + first[3].sum()
        np.testing.assert_array_equal(first[0], second[0])
        for key in ("distance", "is_success"):
            np.testing.assert_array_equal(first[-1][key], second[-1][key])
        if "stopped" in second[-1]:
            told = first[-1]["stopped"][first[-1]["_stopped"]]
            assert told.tolist() == second[-1]["stopped"][second[-1]["_stopped"]].tolist()
            reasons |= set(told.tolist())
        else:
            assert "stopped" not in first[-1]
    assert ended + late > 0
    assert bool(reasons) == bool(ended)


@EVERY
def test_a_step_is_the_machines_motion_under_its_drives(name):
    env = start(name, 4)
    world, state = env.world, env._state
    action = env.action_space.sample() * np.float32(0.3)
    forces = np.float64(action) * world.forces
    m = world.robot.freedom

    def sharp(drive):  # smooth friction, next to that which sticks
        return drive and replace(drive, rest_speed=1e-6)

    legs = tuple(replace(leg, drive=sharp(leg.drive)) for leg in world.robot.legs)
    smooth = replace(world.robot, legs=legs)

    def rates(_, y):
        return np.concatenate([y[m:], pteron.drive_accelerations(smooth, y[:m], y[m:], forces)])

    begin = np.concatenate([state.pose, state.velocity])
    solved = solve_ivp(rates, (0.0, world.period), begin, "LSODA", rtol=1e-10, atol=1e-12)
    solved = solved.y[:, -1]
    seen, reward, ended, late, info = env.step(action)
    np.testing.assert_allclose(
        np.concatenate([env._state.pose, env._state.velocity]), solved, atol=1e-5, rtol=1e-5
    )
    np.testing.assert_allclose(seen[: 2 * m], solved, atol=1e-5, rtol=1e-5)
    away = (state.target - solved[:m]) * np.where(world.robot.platform.angular, 0.1, 1.0)
    distance = np.linalg.norm(away)
    assert info["distance"] == pytest.approx(distance, abs=1e-5)
    expected = (
        1.0 - np.tanh(2.0 * distance / world.spread) - 0.01 * np.mean(np.float64(action) ** 2)
    )
    assert reward == pytest.approx(expected, abs=1e-3)
    assert (ended, late) == (False, False)


def test_drives_with_limits_give_them_and_others_enough_to_move():
    world = start("mixed, driven").world
    assert world.forces.tolist() == [60.0] * 3
    world = start("delta-4").world
    rest = np.zeros(4)
    held = np.abs(pteron.drive_forces(world.robot, world.home, rest, rest))
    assert (world.forces >= 2.0 * held).all()
    lively = pteron.drive_forces(world.robot, world.home, rest, [20.0, -20.0, 20.0, 200.0])
    assert (world.forces >= np.abs(lively)).all()


def test_a_controller_reaches_its_target_and_knows_it():
    env = start("delta-4", 2)
    world, robot = env.world, MACHINES["delta-4"]
    for _ in range(150):
        pose, velocity, target = (env._state.pose, env._state.velocity, env._state.target)
        asked = 100.0 * (target - pose) - 20.0 * velocity
        forces = pteron.drive_forces(robot, pose, velocity, asked)
        _, reward, ended, _, info = env.step(np.float32(forces / world.forces))
        assert not ended
    assert info["is_success"]
    assert info["distance"] < 1e-3
    assert reward > 0.9


def test_a_motion_is_followed_from_where_it_is():
    motion = moved("five-bar")
    env = PteronEnv(CATALOG["five-bar"], motion=motion, period=0.005)
    env.reset(seed=5)
    robot, world = env.world.robot, env.world
    for _ in range(200):
        clock = float(np.mod(env._state.clock, motion.duration))
        np.testing.assert_allclose(world.target(env._state)[0], motion.at(clock)[0])
        pose, velocity, acceleration = motion.at(clock + world.period / 2.0)
        error, rate = pose - env._state.pose, velocity - env._state.velocity
        asked = acceleration + 400.0 * error + 40.0 * rate
        forces = pteron.drive_forces(robot, env._state.pose, env._state.velocity, asked)
        *_, ended, _, info = env.step(np.float32(forces / world.forces))
        assert not ended
        assert info["is_success"]
    assert info["distance"] < 1e-3


@CLIENTS
@EVERY
def test_starts_and_targets_are_safe_and_differ(name):
    world = env_of(name).unwrapped.world
    state = world.start_episodes([np.random.default_rng(seed) for seed in range(40)], None)
    for poses in (state.pose, state.target):
        assert pteron.workspace.pose_margins(world.robot, poses).least.min() >= world.least
        assert len(np.unique(poses[:, 0])) > 30
        sides = np.linalg.det(pteron.jacobian(world.robot, np.vstack([world.home, poses])))
        assert (sides * sides[0] > 0.0).all()
    assert not state.velocity.any()


@pytest.mark.parametrize("name", gated(pteron.catalog(), ["rubin-m2-hexapod", "five-bar"], CLIENTS))
def test_start_target_and_home_differ_on_every_machine(name):
    """Also where the travel is a tenth of a degree; and none is a success at once."""
    world = PteronEnv(name).world
    state = world.start_episodes([np.random.default_rng(seed) for seed in range(40)], None)
    margins = pteron.workspace.pose_margins(world.robot, np.vstack([state.pose, state.target]))
    assert margins.least.min() >= world.least
    assert world.distance(state).min() > world.tolerance
    for poses in (state.pose, state.target):
        assert np.abs(poses - world.home).max(axis=1).min() > 0.0
        assert np.ptp(poses, axis=0).min() > 0.0


def test_a_spread_beyond_the_machine_is_as_far_as_it_goes():
    world = PteronEnv("five-bar", spread=10.0).world
    assert world.spread < 1.0
    state = world.start_episodes([np.random.default_rng(seed) for seed in range(20)], None)
    assert world.distance(state).min() > world.tolerance


def test_what_is_observed_is_true_where_sliders_have_no_limits():
    """A linear Delta without limits, far below home: pose and target are as they are."""
    robot = CATALOG["linear-delta"]
    robot = replace(robot, legs=tuple(replace(leg, limits=None) for leg in robot.legs))
    env = PteronEnv(robot)
    home = env.world.home
    far, target = home - [0.0, 0.0, 5.0], home - [0.0, 0.0, 5.1]
    seen, info = env.reset(seed=1, options={"pose": far, "target": target})
    np.testing.assert_allclose(seen[:3], far, rtol=1e-6)
    np.testing.assert_allclose(seen[6:9], target, rtol=1e-6)
    assert info["distance"] == pytest.approx(0.1)
    assert seen in env.observation_space
    check_env(env, skip_render_check=True, skip_close_check=True)


def test_seeds_are_an_array_too_and_slow_machines_have_a_frame_a_second():
    envs = PteronVectorEnv("five-bar", num_envs=3)
    first = envs.reset(seed=np.array([4, 5, 6]))[0]
    np.testing.assert_array_equal(first, envs.reset(seed=4)[0])
    np.testing.assert_array_equal(first, envs.reset(seed=np.int64(4))[0])
    assert PteronEnv("five-bar", period=10.0).metadata["render_fps"] == 1


def ended_by(name, force, count=200):
    """Return the last step of an episode under a constant share of the forces."""
    env = start(name, 1)
    for _ in range(count):
        found = env.step(np.float32(force) * np.ones(env.action_space.shape, dtype=np.float32))
        if found[2]:
            assert found[0] in env.observation_space
            return found
    raise AssertionError("no end")


@CLIENTS
def test_an_episode_ends_with_its_reason_and_a_reward_of_minus_one():
    reasons = set()
    for name in MACHINES:
        for force in (1.0, -1.0):
            _, reward, _, _, info = ended_by(name, force)
            assert reward == -1.0
            reasons.add(info["stopped"])
    words = " ".join(reasons)
    for part in ("end of its reach", "joint's limit", "type II"):
        assert part in words


def test_options_set_the_pose_and_the_target():
    env = env_of("five-bar").unwrapped
    home = env.world.home
    target = home + np.array([0.01, 0.0])
    seen, info = env.reset(seed=1, options={"pose": home, "target": target})
    np.testing.assert_allclose(seen, [*home, 0.0, 0.0, *target, 0.0, 0.0], atol=1e-6)
    assert info["distance"] == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"goal": [0.0, 0.0]}, "options: 'goal' is unknown; the valid ones are pose, target"),
        ({"pose": [0.0]}, "x y expected"),
        ({"target": [300.0, 0.0]}, "is out of reach"),
        ({"pose": [np.nan, 0.0]}, "x y expected"),
    ],
)
def test_options_that_cannot_be_are_one_line(options, words):
    with pytest.raises(pteron.DataError) as caught:
        env_of("five-bar").unwrapped.reset(options=options)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"period": 0.0}, "period: 0.0 given"),
        ({"tolerance": -1.0}, "tolerance: -1.0 given"),
        ({"spread": np.nan}, "spread: nan given"),
        ({"render_mode": "human"}, "render_mode: 'human' given"),
        ({"robot": "five-barr"}, "five-barr"),
        ({"robot": None}, "robot: NoneType given, a Manipulator expected"),
        ({"motion": "cycle.csv"}, "motion: 'cycle.csv' given, a Motion expected"),
    ],
)
def test_arguments_that_cannot_be_are_one_line(given, words):
    with pytest.raises(pteron.PteronError, match=words.replace(".", r"\.")):
        PteronEnv(**{"robot": CATALOG["five-bar"], **given})


def test_a_machine_may_be_a_path(tmp_path):
    path = pteron.save(CATALOG["five-bar"], tmp_path / "mine.toml")
    assert PteronEnv(path).world.robot == PteronEnv(str(path)).world.robot


@pytest.mark.parametrize(
    ("action", "words"),
    [
        ([0.5], r"action: shape \(1,\) given, \(2,\) expected"),
        ([np.nan, 0.0], "action: not finite numbers given"),
        (["a", "b"], "action: not an array of real numbers"),
    ],
)
def test_actions_that_cannot_be_are_one_line(action, words):
    env = env_of("five-bar").unwrapped
    env.reset(seed=1)
    with pytest.raises(pteron.DataError, match=words):
        env.step(action)


def test_a_motion_that_cannot_be_followed_is_refused():
    motion = moved("five-bar")
    parts = motion.time, motion.pose, motion.velocity, motion.acceleration
    with pytest.raises(pteron.DataError, match="cannot be repeated"):
        PteronEnv(CATALOG["five-bar"], motion=Motion(*(part[:100] for part in parts)))
    beyond = Motion(motion.time, motion.pose + 9.0, motion.velocity, motion.acceleration)
    with pytest.raises(pteron.DataError, match="motion: at 0 s it is out of reach"):
        PteronEnv(CATALOG["five-bar"], motion=beyond)


def test_a_vector_environment_refuses_what_cannot_be():
    with pytest.raises(pteron.DataError, match="num_envs: 0 given"):
        PteronVectorEnv(CATALOG["five-bar"], num_envs=0)
    envs = PteronVectorEnv(CATALOG["five-bar"], num_envs=3)
    with pytest.raises(pteron.DataError, match="step before reset"):
        envs.step(envs.action_space.sample())
    with pytest.raises(pteron.DataError, match="2 seeds given, 3 expected"):
        envs.reset(seed=[1, 2])
    envs.reset(seed=[1, 2, 3])
    with pytest.raises(pteron.DataError, match="3 truth values"):
        envs.reset(options={"reset_mask": np.zeros(3, dtype=bool)})


def test_some_of_many_environments_may_start_anew():
    envs = PteronVectorEnv(CATALOG["five-bar"], num_envs=3)
    before, _ = envs.reset(seed=1)
    mask = np.array([False, True, False])
    after, infos = envs.reset(seed=9, options={"reset_mask": mask})
    assert (before == after).all(axis=1).tolist() == [True, False, True]
    assert infos["_distance"].tolist() == mask.tolist()
    alone, _ = PteronEnv(CATALOG["five-bar"]).reset(seed=10)
    np.testing.assert_array_equal(after[1], alone)


@CLIENTS
@pytest.mark.parametrize("name", ["five-bar", "delta-4"])
def test_a_picture_shows_the_machine(name):
    env = PteronEnv(MACHINES[name], render_mode="rgb_array")
    with pytest.raises(pteron.DataError, match="render before reset"):
        env.render()
    env.reset(seed=1)
    first = env.render()
    assert first.shape[1] == 560
    assert first.dtype == np.uint8
    assert first.shape[2] == 3
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 50
    env.reset(seed=2)
    assert (env.render() != first).any()
    assert env_of(name).unwrapped.render() is None


def test_without_gymnasium_one_line_names_the_extra():
    script = (
        "import sys; sys.modules['gymnasium'] = None\n"
        "try:\n    import pteron.environments\nexcept ImportError as error:\n    print(error)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout.count("\n") == 1
    assert done.stdout.rstrip().endswith(install_command("gymnasium"))
