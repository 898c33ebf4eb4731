"""Environments on an emulated GPU: every observation, reward and end is the processor's."""

import sys
from dataclasses import replace

import numpy as np
import nvrtc
import pytest
from driven_machines import driven
from emulated_gpu import DeviceArray, emulated
from mechanisms import CATALOG, CLIENTS, NIGHTLY, TILTED, gated

import pteron
from pteron.environments import PteronVectorEnv
from pteron.kernels.code import render_template
from pteron.kernels.device_random import DeviceGenerators
from pteron.legs import Drive
from pteron.legs.drive import Elastic
from pteron.motion import machines_about, pick_and_place

COUNT = 6
ELASTIC = Drive(0.3, 0.4, 0.05, 0.5, elastic=Elastic(4e3, 1.0))
DELTA = CATALOG["delta"]
CASES = {
    "delta": (DELTA, {}),
    "five-bar, each its own": (
        CATALOG["five-bar"],
        {"machines": machines_about("five-bar", COUNT, masses=0.1, friction=0.2)},
    ),
    "delta on a motion": (DELTA, {"motion": pick_and_place("delta", [0.0, 0.0, -0.9])}),
    "tripteron with soft belts": (
        replace(
            CATALOG["tripteron"],
            legs=tuple(replace(leg, drive=ELASTIC) for leg in CATALOG["tripteron"].legs),
        ),
        {},
    ),
    "quadrupteron, driven": (driven(CATALOG["quadrupteron"], max_force=60.0), {}),
    "stewart": (TILTED["stewart"], {}),
}


@pytest.fixture
def cupy():
    """Return the emulated GPU in CuPy's place."""
    with emulated() as module:
        yield module


def pair_of(case, **options):
    """Return the environments of a case on the processor and on the GPU."""
    robot, more = CASES[case]
    return [
        PteronVectorEnv(robot, COUNT, **more, **options, **place)
        for place in ({}, {"device": "cuda", "tensors": "cupy"})
    ]


def expect_equal(host, device):
    """Compare observations, rewards and ends, or observations and infos."""
    for expected, present in zip(host, device, strict=True):
        if isinstance(expected, dict):
            assert set(expected) - {"stopped", "_stopped"} == set(present)
            expect_equal([expected[name] for name in present], present.values())
        else:
            assert isinstance(present, DeviceArray)
            np.testing.assert_array_equal(present.get(), expected)
            assert present.dtype == expected.dtype


def expect_equal_steps(case, steps, cupy):
    """Step both with random actions; return how many episodes ended and how many were cut."""
    host, device = pair_of(case, max_episode_steps=40)
    expect_equal(host.reset(seed=5), device.reset(seed=5))
    rng, ended, late = np.random.default_rng(1), 0, 0
    for _ in range(steps):
        actions = rng.uniform(-1.0, 1.0, host.action_space.shape).astype(np.float32)
        expected = host.step(actions)
        expect_equal(expected, device.step(cupy.asarray(actions)))
        ended, late = ended + int(expected[2].sum()), late + int(expected[3].sum())
    return ended, late


@pytest.mark.parametrize("case", gated(CASES, ["delta", "five-bar, each its own"], CLIENTS))
def test_steps_and_resets_are_the_processors(case, cupy):
    ended, late = expect_equal_steps(case, 150, cupy)
    assert ended + late > 3


@NIGHTLY
@pytest.mark.parametrize("case", ["delta", "five-bar, each its own"])
def test_ten_thousand_steps_are_the_processors(case, cupy):
    ended, late = expect_equal_steps(case, 10_000, cupy)
    assert ended > 1000
    assert late > 10


def test_some_start_anew_where_they_are_told(cupy):
    host, device = pair_of("delta")
    expect_equal(host.reset(seed=2), device.reset(seed=2))
    mask = np.arange(COUNT) % 2 == 0
    options = {"reset_mask": mask, "pose": [0.0, 0.05, -0.9]}
    expect_equal(host.reset(options=options), device.reset(options=options))
    options["reset_mask"] = cupy.asarray(mask)
    expected = host.reset(seed=9, options=options | {"reset_mask": mask})
    expect_equal(expected, device.reset(seed=9, options=options))


def test_reasons_and_pictures_are_those_of_the_processor(cupy):
    host, device = pair_of("delta", render_mode="rgb_array")
    host.reset(seed=0), device.reset(seed=0)
    for _ in range(200):
        actions = np.ones(host.action_space.shape, np.float32)
        *_, ended, _, infos = host.step(actions)
        device.step(cupy.asarray(actions))
        if ended.any():
            break
    number = int(ended.argmax())
    assert device.end_reason(number) == infos["stopped"][number]
    np.testing.assert_array_equal(device.render()[0], host.render()[0])


def test_results_are_arrays_of_the_library_that_is_asked_for(cupy):
    jax = pytest.importorskip("jax")
    envs = PteronVectorEnv("delta", 3, device="cuda", tensors="jax")
    observations, infos = envs.reset(seed=0)
    assert isinstance(observations, jax.Array)
    assert isinstance(infos["distance"], jax.Array)
    observations, reward, *_ = envs.step(jax.numpy.zeros((3, 3), "float32"))
    assert isinstance(reward, jax.Array)
    assert observations.shape == (3, 12)


def test_random_numbers_are_numpys(cupy):
    seeds = [0, 7, 2**40]
    device = DeviceGenerators(4)
    device.put([0, 1, 3], [np.random.default_rng(seed) for seed in seeds])
    host = [np.random.default_rng(seed) for seed in seeds]
    for rows, count in (([0, 1, 3], 100), ([3], 7), ([1, 0], 1), ([], 5)):
        present = device.random(cupy.asarray(rows, np.int64), count)
        expected = [host[min(row, 2)].random(count) for row in rows]
        np.testing.assert_array_equal(present.get(), np.reshape(expected, (-1, count)))


def test_nvidia_compiles_the_generators():
    if nvrtc.library() is None:
        pytest.skip("the wheel nvidia-cuda-nvrtc-cu12 is not installed")
    source = render_template("pteron.kernels", "pcg64.cu.j2")
    assert nvrtc.compiled(source, options=("--device-int128",)).spilled == 0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"device": "gpu"}, "device: 'gpu' is not one of cpu, cuda"),
        ({"tensors": "numpy"}, "tensors: 'numpy' is not one of torch, cupy, jax"),
    ],
)
def test_unknown_places_are_refused(options, words):
    with pytest.raises(pteron.DataError, match=words):
        PteronVectorEnv("delta", 2, **options)


def test_actions_are_refused_as_on_the_processor(cupy):
    envs = PteronVectorEnv("delta", 2, device="cuda", tensors="cupy")
    with pytest.raises(pteron.DataError, match="step before reset"):
        envs.step(cupy.zeros((2, 3), np.float32))
    envs.reset(seed=0)
    for actions, words in (
        (cupy.zeros((2, 3)), "action: an array of float64 given, float32 expected"),
        (cupy.zeros((3, 3), np.float32), r"action: shape \(3, 3\) given, \(2, 3\) expected"),
        (np.full((2, 3), np.nan), "action: not finite numbers given"),
    ):
        with pytest.raises(pteron.DataError, match=words):
            envs.step(actions)


def test_without_a_gpu_or_a_library_one_line_says_so(monkeypatch):
    with (
        emulated(available=False),
        pytest.raises(pteron.ModelError, match="needs an NVIDIA GPU"),
    ):
        PteronVectorEnv("delta", 2, device="cuda")
    monkeypatch.setitem(sys.modules, "torch", None)
    with emulated(), pytest.raises(pteron.ModelError, match="'torch' is not installed"):
        PteronVectorEnv("delta", 2, device="cuda")
