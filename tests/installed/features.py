"""What an installed Pteron must do with an extra, and say without it; run by `matrix.py`.

It needs nothing but Pteron: ``python features.py none film`` tries what every installation can do,
and the extra `film`; every other extra that is not there must be asked for by its name.
"""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

import pteron

POSE = [0.01, -0.02, 0.03, 0.2]
VELOCITY, ACCELERATION = [0.1, 0.0, -0.2, 1.0], [2.0, 1.0, 0.0, 5.0]
FORCES = [31.909, -2.963, 8.508, 5.71]
"""N, as docs/start/tour.md prints them."""


def expect_forces(forces: object) -> None:
    """Refuse forces that are not those of the tour."""
    np.testing.assert_allclose(np.asarray(forces), FORCES, atol=6e-4)


def first_results() -> None:
    """Try what the tour shows first; a missing compiler is missed only where it is asked."""
    robot = pteron.load("quadrupteron")
    state = POSE, VELOCITY, ACCELERATION
    expect_forces(pteron.inverse_dynamics(robot, *state))
    base = pteron.base_parameters(robot)
    assert base.rank == 26
    expect_forces(pteron.base_regressor(robot, base, *state) @ base.values())
    # Enough work for the C code to be asked for, which must not be missed where it cannot be had.
    poses = np.tile(POSE, (200_000, 1))
    many = pteron.inverse_dynamics(robot, poses, VELOCITY, ACCELERATION)
    expect_forces(many[-1])
    if shutil.which("cc") or shutil.which("gcc"):
        expect_forces(pteron.compile(robot, "inverse_dynamics", "c")(*state))
    else:
        told = refusal(lambda: pteron.compile(robot, "inverse_dynamics", "c")(*state))
        assert "C compiler" in told, told


def everywhere() -> None:
    """Try what needs no extra: files, the command line, code for a controller, pages, a log."""
    robot = pteron.load("quadrupteron")
    pteron.save(robot, "robot.toml")
    assert pteron.load("robot.toml") == robot
    command("--version")
    command("check", "robot.toml")
    command("inverse", "delta", "0", "0", "-0.9", "--json")
    command("export", "quadrupteron", "--c", "controller")
    command("cycle", "robot.toml", "--out", "cycle.parquet")
    command("report", "tripteron", "--out", "page")
    assert (Path("page") / "report.html").stat().st_size > 50_000
    command("simulate", "five-bar", "--out", "run")
    command("identify", "run/simulation.csv", "--robot", "five-bar", "--out", "identified")


def cluster() -> None:
    """Make a map in another process, into a store of arrays."""
    grid = pteron.maps.pose_grid("five-bar", points=5)
    pteron.maps.map_index("five-bar", "condition", grid, out="map.zarr", workers=1)
    assert (Path("map.zarr") / "zarr.json").exists()


def consistency() -> None:
    """Find real bodies."""
    robot = pteron.load("tripteron")
    base = pteron.base_parameters(robot)
    found = pteron.identification.consistent_model(robot, base, base.values())
    assert found.feasible


def design() -> None:
    """Search for dimensions."""
    spec = pteron.design.Spec.model_validate(
        {
            "robot": "five-bar",
            "variables": [{"moves": "legs.lower_length", "by": "factor", "range": (0.7, 1.3)}],
            "workspace": {"low": (-0.02, 0.01), "high": (0.02, 0.05)},
            "objectives": [{"minimise": "links"}],
            "search": {"population": 4, "generations": 1},
        }
    )
    assert len(pteron.design.search(spec))


def film() -> None:
    """Write a film of some pictures."""
    robot = pteron.load("five-bar")
    way = pteron.motion.pick_and_place(robot, pteron.workspace.home_pose(robot), samples=21)
    pteron.plots.film(robot, way, "cycle.mp4", fps=4.0, size=(320, 240))
    assert Path("cycle.mp4").read_bytes()[4:8] == b"ftyp"


def gymnasium() -> None:
    """Take a step in the environment."""
    reach = pteron.environments.REACH
    import gymnasium as gym

    world = gym.make(reach, robot="delta")
    world.reset(seed=1)
    _, reward, *_ = world.step(world.action_space.sample())
    assert np.isfinite(reward)
    world.close()


def jax() -> None:
    """Run JAX's code."""
    kernel = pteron.compile(pteron.load("quadrupteron"), "inverse_dynamics", "jax")
    expect_forces(kernel(POSE, VELOCITY, ACCELERATION))


def motion() -> None:
    """Find a motion in the shortest time, and one with limited jerk."""
    robot = pteron.load("tripteron")
    limits = pteron.motion.limits_of(robot, speed=1.0, acceleration=10.0)
    path = pteron.motion.line_path(robot, [[0.0, 0.0, 0.0], [0.1, 0.0, 0.05]])
    quickest = pteron.motion.time_optimal(robot, path, limits)
    assert quickest.duration < quickest.polynomial
    ends = [0.0, 0.0, 0.0], [0.1, 0.0, 0.05]
    assert pteron.motion.jerk_limited(robot, *ends, 100.0, limits).duration > 0.0


def numba() -> None:
    """Run Numba's code."""
    kernel = pteron.compile(pteron.load("quadrupteron"), "inverse_dynamics", "numba")
    expect_forces(kernel(POSE, VELOCITY, ACCELERATION))


def oracles() -> None:
    """Open the exported machine in MuJoCo and in Pinocchio."""
    robot = pteron.load("delta")
    assert pteron.export.pinocchio_model(robot)
    import mujoco

    pteron.export.export_mjcf(robot, "engine")
    (file,) = Path("engine").glob("*.xml")
    assert mujoco.MjModel.from_xml_path(str(file)).nv > 3


def surfaces() -> None:
    """Draw the surface of a map."""
    region = dict.fromkeys("xyz", (-0.05, 0.05))
    grid = pteron.maps.pose_grid("tripteron", ranges=region, points=8)
    found = pteron.maps.map_index("tripteron", "condition", grid)
    assert all(len(one.triangles) for one in pteron.maps.surfaces(found, "condition"))


EXTRAS: dict[str, tuple[Callable[[], None], str]] = {
    "cluster": (cluster, "distributed"),
    "consistency": (consistency, "clarabel"),
    "design": (design, "pymoo"),
    "film": (film, "imageio_ffmpeg"),
    "gymnasium": (gymnasium, "gymnasium"),
    "jax": (jax, "jax"),
    "motion": (motion, "ruckig"),
    "numba": (numba, "numba"),
    "oracles": (oracles, "mujoco"),
    "surfaces": (surfaces, "skimage"),
}
"""What tries an extra, and a module that it brings."""

TOLD = tuple(name for name in EXTRAS if name != "film")
"""Extras whose absence Pteron tells by name; FFmpeg may be the machine's own."""


def command(*arguments: str) -> str:
    """Run `pteron` as it was installed; it must be content."""
    program = Path(sys.executable).with_name("pteron" + Path(sys.executable).suffix)
    done = subprocess.run(
        [str(program), *arguments], capture_output=True, text=True, encoding="utf-8", check=False
    )
    assert done.returncode == 0, f"pteron {' '.join(arguments)}: {done.stderr}"
    return done.stdout


def refusal(call: Callable[[], object]) -> str:
    """Return the message with which a call is refused."""
    try:
        call()
    except (ImportError, pteron.PteronError) as error:
        return str(error)
    raise AssertionError(f"{call}: not refused")


def expect_told(extra: str) -> None:
    """Refuse anything but one line that names the extra, where it is not installed."""
    told = refusal(EXTRAS[extra][0])
    assert f"pteron[{extra}]" in told, told
    assert "\n" not in told, told


def main() -> None:
    """Try the extras named; all others must be told by name where they are missing."""
    given = [name for name in sys.argv[1:] if name != "none"]
    first_results()
    if given in ([], ["all"]):
        everywhere()
    for name in EXTRAS if "all" in given else given:
        EXTRAS[name][0]()
    for name in TOLD:
        if importlib.util.find_spec(EXTRAS[name][1]) is None:
            expect_told(name)
    print("works:", pteron.__version__, *given)


if __name__ == "__main__":
    main()
