"""Films can be watched, show the motion in one view, and are there as a whole or not at all."""

import json
import re
import subprocess
import tempfile
from base64 import b64encode
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from commands import done, refused, run
from mechanisms import CLIENTS, gated
from PIL import Image, ImageSequence

import pteron
from pteron.errors import DataError, OutputError, PteronError
from pteron.motion import Motion, pick_and_place
from pteron.plots import film

SIZE = (240, 180)
TRIPTERON = pteron.load("tripteron")
CYCLE = pick_and_place(TRIPTERON, [0.0, 0.0, 0.0], duration=1.0, samples=41)


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    # What is not finished would be found here.
    (tmp_path / "unfinished").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "unfinished"))


def decoded(path):
    """Return what FFmpeg says of an MP4, and its frames (K, height, width, 3)."""
    raw = ("-f", "rawvideo", "-pix_fmt", "rgb24", "-")
    program = imageio_ffmpeg.get_ffmpeg_exe()
    done = subprocess.run([program, "-i", str(path), *raw], capture_output=True, check=True)
    told = done.stderr.decode()
    width, height = map(int, re.search(r"(\d{3})x(\d{3})", told).groups())
    return told, np.frombuffer(done.stdout, np.uint8).reshape(-1, height, width, 3).astype(int)


def unpacked(path):
    """Return the frames of a GIF, and how long each is seen, s."""
    frames, times = [], []
    with Image.open(path) as film:
        for page in ImageSequence.Iterator(film):
            frames.append(np.asarray(page.convert("RGB")).astype(int))
            times.append(page.info["duration"] / 1e3)
    return np.array(frames), times


@CLIENTS
@pytest.mark.parametrize("turns", gated([0.0, 1.0], [1.0]))
def test_an_mp4_plays_in_a_browser_at_the_speed_it_says(turns):
    made = film(TRIPTERON, CYCLE, "cycle.mp4", fps=8.0, speed=0.5, size=SIZE, turns=turns)
    told, frames = decoded(made.path)
    assert "Video: h264" in told
    assert "yuv420p" in told
    assert "8 fps" in told
    assert frames.shape[1:] == (SIZE[1], SIZE[0], 3)
    assert len(frames) == made.frames == 1 + round(CYCLE.duration / 0.5 * 8.0)
    minutes, seconds = re.search(r"Duration: 00:(\d+):([\d.]+)", told).groups()
    assert 60.0 * int(minutes) + float(seconds) == pytest.approx(made.duration, abs=0.02)
    assert b"moov" in made.path.read_bytes()[:4096], "it can be watched while it is loaded"
    # The cycle is closed, and H.264 rounds.
    away = [np.abs(frame - frames[0]).mean() for frame in frames]
    assert 5.0 * away[-1] < away[8]
    assert not list(Path("unfinished").iterdir())
    assert b64encode(made.path.read_bytes()).decode() in made._repr_html_()


@pytest.mark.parametrize("name", gated(["tripteron", "five-bar", "h4"], ["five-bar"]))
def test_a_gif_shows_the_machine_move_in_one_view(name):
    robot = pteron.load(name)
    start = np.zeros(robot.freedom)
    start = pteron.workspace.home_pose(robot) if name != "tripteron" else start
    cycle = pick_and_place(robot, start, duration=1.0, samples=41, least=0.05)
    made = film(robot, cycle, "cycle.gif", fps=10.0, speed=1.0, size=SIZE)
    frames, times = unpacked(made.path)
    assert frames.shape[1:] == (SIZE[1], SIZE[0], 3)
    assert sum(times) == pytest.approx(made.duration)
    assert made.duration == pytest.approx(1.0, abs=1.5 / made.fps)
    np.testing.assert_array_equal(frames[0], frames[-1])
    inked = frames[0].min(axis=-1) < 250
    assert inked.mean() > 0.01
    assert (frames[0] == 255).all(axis=-1).mean() > 0.5, "paper is white"
    # Guides, ground and scales stay where they are; the platform does not.
    still = (frames == frames[0]).all(axis=(0, -1))
    assert 0.3 < still[inked].mean() < 1.0


def test_the_forces_below_have_a_line_that_says_when():
    forces = pteron.inverse_dynamics(TRIPTERON, *(CYCLE.pose, CYCLE.velocity, CYCLE.acceleration))
    made = film(TRIPTERON, CYCLE, "cycle.gif", fps=5.0, speed=1.0, size=SIZE, forces=forces)
    low = unpacked(made.path)[0][:, -SIZE[1] // 5 : -SIZE[1] // 8]
    moving = (low != low[0]).any(axis=(1, 3))
    columns = [np.flatnonzero(row).max() for row in moving[1:]]
    assert columns == sorted(columns)
    assert len(set(columns)) == len(columns)


@pytest.mark.parametrize(
    ("options", "kind", "words"),
    [
        ({"path": "cycle.avi"}, OutputError, ".avi ending, .mp4 or .gif expected"),
        ({"path": "none/cycle.gif"}, OutputError, "no folder"),
        ({"size": (161, 120)}, DataError, "two even numbers"),
        ({"size": 240}, DataError, "2 values (each a whole number) expected"),
        ({"size": (float("nan"), 240)}, DataError, "2 values (each a whole number) expected"),
        ({"fps": 0.0}, DataError, "fps: 0 given"),
        ({"speed": -1.0}, DataError, "speed: -1 given"),
        ({"speed": 1e-4}, DataError, "frames"),
        ({"speed": 1e-2, "size": (1920, 1080)}, DataError, "too much for a GIF"),
        ({"forces": np.zeros((3, 3))}, DataError, "forces: shape"),
        ({"motion": Motion([0.0], *np.zeros((3, 1, 3)))}, DataError, "ascend"),
        ({"motion": Motion([0.0, 1.0], *np.zeros((3, 2, 4)))}, DataError, "pose"),
    ],
)
def test_what_makes_no_film_is_told_before_the_work(options, kind, words):
    given = {"motion": CYCLE, "path": "cycle.gif", "size": SIZE} | options
    with pytest.raises(kind) as caught:
        film(TRIPTERON, **given)
    assert words in str(caught.value)
    assert not list(Path().glob("cycle*"))


def test_without_the_encoder_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    with pytest.raises(PteronError, match=r"-m pip install .*\[film\].*\.gif"):
        film(TRIPTERON, CYCLE, "cycle.mp4")


@CLIENTS
@pytest.mark.parametrize("ending", ["mp4", "gif"])
def test_an_interrupted_film_leaves_what_was_there(ending):
    done = []

    def stop(share):
        done.append(share)
        if len(done) == 3:
            raise KeyboardInterrupt

    target = Path(f"cycle.{ending}")
    target.write_bytes(b"the last one")
    with pytest.raises(KeyboardInterrupt):
        film(TRIPTERON, CYCLE, target, size=SIZE, progress=stop)
    assert target.read_bytes() == b"the last one"
    assert not list(Path("unfinished").iterdir())
    assert [path.name for path in Path().iterdir() if path.is_file()] == [target.name]


@CLIENTS
def test_the_command_films_the_standard_cycle_and_a_table():
    short = "--fps 4 --size 240x180"
    told = json.loads(done(f"film tripteron -o cycle.gif --speed 1 {short} --json"))
    # Frames that are alike are one that is seen longer.
    assert sum(unpacked("cycle.gif")[1]) == pytest.approx(told["frames"] / told["fps"])
    run("cycle five-bar --duration 1 --rate 50 --out motion.csv")
    text = done(f"film five-bar --cycle motion.csv -o motion.mp4 --forces {short}")
    assert "1 s of motion at 0.5 times real speed; the film has 2.25 s, 9 frames of 240x180" in text
    assert len(decoded("motion.mp4")[1]) == 9
    refused("film five-bar -o a.gif --turns 1", "five-bar is planar")
    refused("film tripteron -o a.gif --size big", "--size: 'big' given", "960x720")
    refused("film tripteron -o a.avi", "a.avi: .avi ending, .mp4 or .gif expected")
