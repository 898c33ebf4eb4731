"""`pteron identify`: files that agree with each other, a table to read, refusals of one line."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from commands import done, refused, run
from logs_of_motions import log_of, motion
from mechanisms import CATALOG, CLIENTS
from page_reader import Reader, strict

import pteron
from pteron.cli import identify as command
from pteron.cli.progress import TimeLeft, progress_bar
from pteron.extras import install_command
from pteron.identification import METHODS, write_log
from pteron.identification.model import Passive
from pteron.identification.signals import Derivatives
from pteron.progress import Share

FILES = ["identification.html", "identification.json"]


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@lru_cache
def log(robot: str, seed: int = 3, period: float = 4.0):
    noise = {"joint_noise": 2e-7, "force_noise": 0.05}
    return log_of(
        CATALOG[robot], duration=6.0, rate=400.0, seed=seed, noise_seed=seed, period=period, **noise
    )


@pytest.fixture
def _drawn_quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the pictures to the tests that look at them."""
    monkeypatch.setattr("pteron.report.identification.page.page", lambda result, file: "<p>")


QUICK = pytest.mark.usefixtures("_drawn_quickly")


@CLIENTS
def test_the_files_agree_with_each_other_and_with_the_terminal():
    robot = "tripteron"
    write_log(log(robot), "fit.csv")
    write_log(log(robot, 5, 3.0), "other.parquet")
    text = done(f"identify fit.csv --held-out other.parquet --robot {robot} --out a/b")
    folder = Path("a/b")
    assert sorted(file.name for file in folder.iterdir()) == [*FILES, f"{robot}.toml"]
    data = strict((folder / "identification.json").read_text(encoding="utf-8"))
    grade = data["verdict"]["grade"]
    error = "error of the forces predicted in held-out data: up to "
    assert text.startswith(f"{robot}: {grade}; {error}")
    assert "\x1b" not in text
    for name in data["estimate"]["names"]:
        assert f"\n {name} " in text
    for line in (*data["verdict"]["reasons"], *data["verdict"]["next_steps"]):
        assert f"{line}\n" in text
    for file in folder.iterdir():
        assert f"Written: {file}\n" in text
    weak = {*data["unseen"], *data["essential"]["dropped"]}
    rows = [line.split() for line in text.splitlines() if line.startswith(" ")]
    marked = {cells[0] for cells in rows if cells and cells[-1] in ("weak", "unseen")}
    assert weak
    assert marked == weak

    page = Reader((folder / "identification.html").read_text(encoding="utf-8"))
    assert page.faults == page.open == page.sources == []
    assert grade.capitalize() in page.text
    assert f"{robot}.toml" in page.text

    machine = pteron.load(folder / f"{robot}.toml")
    np.testing.assert_allclose(pteron.parameters(machine), data["real_bodies"]["parameters"])
    base = pteron.base_parameters(machine)
    identified = data["estimate"]["values"][: base.rank]
    if data["real_bodies"]["feasible"]:
        np.testing.assert_allclose(base.values(), identified, atol=1e-9)
    # The file's bodies do what those of the machine that made the log do.
    state = motion(CATALOG[robot], np.arange(400) / 100.0, seed=9)
    true = pteron.inverse_dynamics(CATALOG[robot], *state)
    error = pteron.inverse_dynamics(machine, *state) - true
    assert (error.std(axis=0) < 0.05 * true.std(axis=0)).all()
    assert done(f"check {folder / machine.name}.toml")


@QUICK
def test_json_is_what_is_in_the_file():
    write_log(log("tripteron"), "fit.csv")
    found = strict(done("identify fit.csv --robot tripteron --out out --json"))
    files = found.pop("files")
    assert files == [*(f"out/{name}" for name in FILES), "out/tripteron.toml"]
    assert found == strict(Path("out/identification.json").read_text(encoding="utf-8"))


@QUICK
def test_cranks_are_identified_too():
    joints = tuple(leg.joint for leg in CATALOG["delta"].legs)
    write_log(replace(log("delta"), symbols=joints), "fit.csv")
    assert Path("fit.csv").read_text().startswith("t,theta1,theta2,theta3,torque1,torque2,torque3")
    found = strict(done("identify fit.csv --robot delta --out out --json"))
    units = dict(zip(found["estimate"]["names"], found["estimate"]["units"], strict=True))
    assert (units["I_u1"], units["Fc1"], units["Fv1"]) == ("kg m^2", "N m", "N m s")
    true = pteron.base_parameters(CATALOG["delta"]).values()
    estimate = found["estimate"]
    values, deviations = (np.array(estimate[k])[:13] for k in ("values", "standard_deviations"))
    assert (np.abs(values - true) < 6.0 * deviations).all()


@CLIENTS
@QUICK
def test_options_reach_the_work():
    write_log(log("tripteron"), "a.csv")
    write_log(log("tripteron", 7), "b.csv")
    write_log(log("tripteron", 5, 3.0), "c.csv")
    write_log(log("tripteron", 6, 3.0), "d.csv")
    line = (
        "identify a.csv b.csv --held-out c.csv --held-out d.csv --robot tripteron --out out --json"
        " --estimator huber --without viscous,offset --joints shared --derivatives spline"
        " --band 15 --cad none --box u=-0.3,0.4,-0.2,0.2 --shared"
    )
    found = json.loads(done(line))
    assert [p["source"] for p in found["fitted"]] == ["a.csv", "b.csv"]
    assert [p["source"] for p in found["held_out"]] == ["c.csv", "d.csv"]
    assert found["estimate"]["method"] == "huber"
    names = found["estimate"]["names"]
    assert "Fc1" in names
    assert "Fv_R1" in names
    assert not {"Fv1", "offset1"} & set(names)
    assert "mgx_u" in names, "legs share their parameters"
    for treatment in found["preprocessing"]:
        assert (treatment["derivatives"], treatment["band"]) == ("spline", 15.0)
    text = done(line.replace(" --json", ""))
    assert " 1 in c.csv " in text
    assert " 3 in d.csv " in text
    periodic = "identify a.csv --robot tripteron --out out --json --period 4 --cutoff 20"
    assert json.loads(done(periodic))["preprocessing"][0]["period"] == 4.0


def test_choices_are_those_of_the_library():
    assert set(command.Estimator.__args__) == set(METHODS)
    assert set(command.Passive.__args__) == set(Passive.__args__)
    assert set(command.Derivatives.__args__) == set(Derivatives.__args__)


@CLIENTS
@QUICK
def test_findings_and_a_bad_verdict_are_said_plainly():
    good, other = log("tripteron"), log("tripteron", 5, 3.0)
    table = {"t": good.time, **{f"rho{i + 1}": c for i, c in enumerate(good.joints.T)}}
    table |= {f"force{i + 1}": c for i, c in enumerate(good.forces.T)}
    frame = pl.DataFrame(table)
    pl.concat([frame[:1000], frame[1010:]]).write_csv("gap.csv")
    wrong = other.forces + 14.0 * np.sin(9.0 * other.time)[:, None]
    held = {"t": other.time, **{f"rho{i + 1}": c for i, c in enumerate(other.joints.T)}}
    pl.DataFrame(held | {f"force{i + 1}": c for i, c in enumerate(wrong.T)}).write_csv("bad.csv")
    text = done("identify gap.csv --held-out bad.csv --robot tripteron --out out")
    assert text.startswith("tripteron: not trustworthy; ")
    assert "Note: gap.csv: " in text
    assert "# Verdict: not trustworthy." in Path("out/tripteron.toml").read_text()
    assert (
        "not trustworthy"
        in run(
            "identify gap.csv --held-out bad.csv --robot tripteron --out out", FORCE_COLOR="1"
        ).stdout
    )


@QUICK
def test_without_a_solver_there_is_no_model_file(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "clarabel", None)
    write_log(log("tripteron"), "fit.csv")
    text = done("identify fit.csv --robot tripteron --out out")
    assert sorted(file.name for file in Path("out").iterdir()) == FILES
    assert text.count(install_command("consistency")) == 1
    assert strict(Path("out/identification.json").read_text())["real_bodies"] is None


def _damaged(name: str) -> str:
    """Write a log that is wrong in one way, and return its name."""
    good = log("quadrupteron")
    frame = pl.DataFrame(
        {
            "t": good.time,
            **{f"rho{i + 1}": c for i, c in enumerate(good.joints.T)},
            **{f"force{i + 1}": c for i, c in enumerate(good.forces.T)},
        }
    )
    if name == "nan.csv":
        frame[1233, "force3"] = float("nan")
    elif name == "swapped.csv":
        frame = frame.rename({"force2": "force3", "force3": "force2"})
    elif name == "short.csv":
        frame = frame[:3]
    elif name == "text.csv":
        Path(name).write_text("no log\n")
        return name
    frame.write_csv(name)
    return name


@pytest.mark.parametrize(
    ("file", "options", "words"),
    [
        ("good.csv", "--robot tripteron --out out", ["for 4 sliders", "has 3 legs"]),
        ("good.csv", "--robot quadruptron --out out", ["neither a file", '"quadrupteron"']),
        ("good.csv", "--robot quadrupteron --out good.csv", ["it is a file"]),
        ("good.csv", "--robot quadrupteron --out good.csv/out", ["good.csv/out", "folder"]),
        ("good.csv", "--robot quadrupteron", ["Missing option '--out'"]),
        ("good.csv", "--robot quadrupteron --out o --held-out no.csv", ["no.csv: no such file"]),
        ("good.csv", "--robot quadrupteron --out o --without friction", ["'friction'", "viscous"]),
        ("good.csv", "--robot quadrupteron --out o --estimator best", ["'best'", "'huber'"]),
        ("good.csv", "--robot quadrupteron --out o --box u1=1,2", ["'u1=1,2'", "four numbers"]),
        ("good.csv", "--robot quadrupteron --out o --box v=0,1,0,1", ["'v' is no body"]),
        ("good.csv", "--robot quadrupteron --out o --cutoff 900", ["900 Hz", "below 200 Hz"]),
        ("good.csv", "--robot quadrupteron --out o --cad none.toml", ["none.toml: neither"]),
        ("nan.csv", "--robot quadrupteron --out a/b", ["nan.csv: row 1234", "force3"]),
        ("swapped.csv", "--robot quadrupteron --out a/b", ["force2 and force3 are swapped"]),
        ("short.csv", "--robot quadrupteron --out out", ["short.csv: 3 rows given"]),
        ("text.csv", "--robot quadrupteron --out out", ["text.csv: "]),
    ],
)
def test_what_cannot_be_identified_is_one_line(file: str, options: str, words: list[str]):
    message = refused(f"identify {_damaged(file)} {options}", *words)
    assert "Traceback" not in message


def test_files_that_are_read_are_not_replaced():
    write_log(log("tripteron"), "tripteron.csv")
    refused("identify tripteron.csv --robot tripteron --out .", "the description of tripteron.csv")
    pteron.save(pteron.load("tripteron"), "tripteron.toml")
    write_log(log("tripteron"), "log.csv")
    refused("identify log.csv --robot tripteron.toml --out .", "would replace a file that is read")
    refused("identify no.csv --robot tripteron --out out", "no.csv: no such file")


@QUICK
def test_the_time_left_is_that_of_this_run_and_grows_while_nothing_is_done():
    clock = [0.0]
    left = TimeLeft(lambda: clock[0])
    assert left.words() == ""
    left.tell(0.5)  # an earlier run's
    for second in range(1, 401):
        clock[0] = float(second)
        left.tell(0.5 + second / 2000.0)
        # A share of 0.5 took 1000 s; before 20 s too little is done to say so.
        assert left.seconds() == (pytest.approx(1000.0 - second) if second >= 20 else None)
    assert left.words() == "about 10 min left"
    clock[0] = 800.0  # 0.3 is left; 0.1 was done in the last 600 s
    assert left.seconds() == pytest.approx(1800.0, rel=0.01)
    clock[0] = 804.0
    left.tell(0.99)
    assert re.fullmatch(r"about \d+ s left", left.words())
    left.tell(1.0)
    assert left.words() == "about 0 s left"


@QUICK
def test_each_stage_shows_a_bar(monkeypatch: pytest.MonkeyPatch):
    write_log(log("tripteron"), "fit.csv")
    line = "identify fit.csv --robot tripteron --out out"
    assert run(line, FORCE_COLOR="1").stderr == ""
    monkeypatch.setenv("TTY_INTERACTIVE", "1")
    shown = run(line, FORCE_COLOR="1")
    assert shown.exit_code == 0
    assert "Reading" in shown.stderr
    assert "Looking for faults" in shown.stderr
    with progress_bar("Working") as tell:
        for share in (0.1, 0.5, 0.5, 1.0):
            tell(Share(share, "Reading"))
            tell(share)
