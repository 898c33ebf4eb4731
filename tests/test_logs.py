"""Logs of motions: what is read, what is refused, what is found, whole and in pieces."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from logs_of_motions import machine
from mechanisms import CATALOG

import pteron
from pteron.errors import DataError
from pteron.identification import identify
from pteron.identification.logs import (
    Description,
    KnownPayload,
    Log,
    find_description,
    joint_symbols,
    open_log,
    read_description,
    read_log,
    write_description,
    write_log,
)
from pteron.identification.logs.names import parse_column_name

QUADRUPTERON = CATALOG["quadrupteron"]
TRIPTERON = CATALOG["tripteron"]
STEP = 1e-3


def motion(robot=QUADRUPTERON, rows=500, seed=0, *, pose=True, payload=True) -> Log:
    """Return a log whose numbers have all their digits."""
    rng = np.random.default_rng(seed)
    n = robot.freedom
    time = np.arange(rows) * STEP
    wave = np.sin(np.outer(time, rng.uniform(40.0, 90.0, n)) + rng.uniform(0, 6, n))
    return Log(
        "made",
        time,
        0.06 * wave + 1e-6 * rng.normal(size=(rows, n)),
        20.0 * wave + rng.normal(size=(rows, n)),
        pose=rng.uniform(-0.1, 0.1, (rows, n)) if pose else None,
        payload=(np.arange(rows) >= rows // 2).astype(np.int64) if payload else None,
    )


def columns(log: Log) -> dict[str, np.ndarray]:
    n = log.joints.shape[1]
    return (
        {"t": log.time.copy()}
        | {f"rho{j + 1}": log.joints[:, j].copy() for j in range(n)}
        | {f"force{j + 1}": log.forces[:, j].copy() for j in range(n)}
    )


def saved(folder: Path, given: dict[str, object], name: str = "motion.csv", toml: str = "") -> Path:
    path = folder / name
    frame = pl.DataFrame(given)
    frame.write_csv(path) if path.suffix == ".csv" else frame.write_parquet(path)
    if toml:
        path.with_suffix(".toml").write_text(toml, encoding="utf-8")
    return path


def renamed(given: dict[str, np.ndarray], names: dict[str, str]) -> dict[str, np.ndarray]:
    return {names.get(key, key): value for key, value in given.items()}


def assert_same(one: Log, other: Log) -> None:
    for key in ("time", "joints", "forces", "pose", "payload"):
        a, b = getattr(one, key), getattr(other, key)
        assert (a is None) == (b is None), key
        if a is not None:
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(
    ("ending", "robot", "extras"),
    [
        (".csv", QUADRUPTERON, True),
        (".parquet", QUADRUPTERON, True),
        (".csv", TRIPTERON, True),
        (".csv", QUADRUPTERON, False),
    ],
)
def test_a_log_written_is_read_back_bit_for_bit(tmp_path, ending, robot, extras):
    log = motion(robot, pose=extras, payload=extras)
    path = write_log(log, tmp_path / f"motion{ending}")
    back = read_log(path, robot)
    assert_same(log, back)
    assert back.findings == ()
    assert back.source == str(path)
    assert back.rate == pytest.approx(1000.0)
    assert back.duration == log.time[-1]
    assert back.payload is None or back.payload.dtype == np.int64


@pytest.mark.parametrize("unit", ["A", "%"])
def test_forces_in_a_drives_unit_are_written_with_it(tmp_path, unit):
    log = replace(motion(), description=Description(column_force_unit=unit))
    back = read_log(write_log(log, tmp_path / "motion.csv"), QUADRUPTERON)
    assert_same(log, back)
    assert back.description.force_unit == unit


@pytest.mark.parametrize(
    ("ending", "rows"), [(".csv", 7), (".csv", 499), (".csv", 10_000), (".parquet", 100)]
)
def test_pieces_together_are_the_whole(tmp_path, ending, rows):
    path = write_log(motion(), tmp_path / f"motion{ending}")
    whole = read_log(path, QUADRUPTERON)
    done: list[int] = []
    file = open_log(path, QUADRUPTERON)
    pieces = list(file.pieces(rows, done.append))
    assert sum(done) == 500
    assert [p.first_row for p in pieces] == list(range(0, 500, rows))
    assert file.rows_estimate == pytest.approx(500, rel=0.05)
    for key in ("time", "joints", "forces", "pose", "payload"):
        together = np.concatenate([getattr(p, key) for p in pieces])
        np.testing.assert_array_equal(together, getattr(whole, key))
    assert pieces[-1].place(0) == whole.place(pieces[-1].first_row)


def test_a_part_knows_its_rows():
    log = motion()
    part = log.part(100, 200).part(10, 20)
    assert (part.rows, len(part), part.first_row) == (10, 10, 110)
    assert part.place(0) == "made: row 111"
    np.testing.assert_array_equal(part.forces, log.forces[110:120])
    assert part.segments == (slice(0, 10),)


@pytest.mark.parametrize(
    ("column", "cell", "words"),
    [
        ("t", "", "the cell is empty"),
        ("rho3", "nan", "'nan' given, a finite number expected; correct the cell$"),
        ("force4", "-inf", "'-inf' given, a finite number expected"),
        ("t", "fast", "'fast' given, a number expected"),
        ("rho3", "1_0", "'1_0' given, a number expected"),
        ("rho3", "\x1b[31m" + "7" * 500, r"'\\x1b\[31m7{55}\.\.\.' given"),
    ],
)
def test_a_bad_cell_is_refused_with_row_line_and_column(tmp_path, column, cell, words):
    given = columns(motion())
    given = {key: [repr(float(v)) for v in values] for key, values in given.items()}
    given[column][17] = cell
    path = saved(tmp_path, given)
    message = rf"motion\.csv: row 18 \(line 19\), column {column}: .*{words}"
    with pytest.raises(DataError, match=message):
        read_log(path, QUADRUPTERON)


def test_a_ragged_row_is_refused_though_its_end_is_not_needed(tmp_path):
    path = saved(tmp_path, columns(motion()) | {"v": np.zeros(500), "w": np.zeros(500)})
    lines = path.read_text().splitlines()
    lines[30] = lines[30].partition(",")[2]
    path.write_text("\n".join(lines))
    with pytest.raises(
        DataError, match=r"row 30 \(line 31\) has 10 cells, but the header names 11"
    ):
        read_log(path, QUADRUPTERON)


@pytest.mark.parametrize(("ending", "rows"), [(".csv", 0), (".csv", 49), (".parquet", 0)])
def test_too_few_rows_are_refused(tmp_path, ending, rows):
    path = write_log(motion(rows=rows), tmp_path / f"motion{ending}")
    with pytest.raises(DataError, match=f"{rows} rows given, at least 50 expected"):
        read_log(path, QUADRUPTERON)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"t": "when"},
            r"no columns for the time \(found: when, rho1(?s:.*)\[time\]\ncolumn = .when",
        ),
        ({"rho2": "spot"}, r"the columns rho1, rho3, rho4 are for 3 sliders, but .* 4 legs"),
        (
            {f"rho{j}": f"spot{j}" for j in range(1, 5)},
            r"no columns for the sliders (?s:.*)\[joints\]\n",
        ),
        (
            {f"force{j}": f"x{j}" for j in range(1, 5)},
            r"no columns for the forces (?s:.*)\[forces\]\n",
        ),
        ({"force4": "effort"}, "3 forces, but the machine has 4 legs.*another machine"),
    ],
)
def test_missing_columns_are_refused(tmp_path, change, words):
    path = saved(tmp_path, renamed(columns(motion()), change))
    with pytest.raises(DataError, match=words):
        open_log(path, QUADRUPTERON)


@pytest.mark.parametrize(("robot", "other"), [(QUADRUPTERON, TRIPTERON), (TRIPTERON, QUADRUPTERON)])
def test_the_log_of_another_machine_is_refused(tmp_path, robot, other):
    path = write_log(motion(robot), tmp_path / "motion.csv")
    with pytest.raises(DataError, match="perhaps it is the log of another machine"):
        open_log(path, other)


def test_ambiguous_and_duplicate_columns_are_refused(tmp_path):
    given = columns(motion())
    path = saved(tmp_path, given)
    lines = path.read_text().splitlines(keepends=True)
    path.write_text(lines[0].replace("force4", "rho1") + "".join(lines[1:]))
    with pytest.raises(DataError, match="two columns are called 'rho1'"):
        open_log(path, QUADRUPTERON)
    names = {f"rho{j}": f"q{j}" for j in range(1, 5)}
    both = renamed(given, names) | {f"s{j}": given[f"rho{j}"] for j in range(1, 5)}
    with pytest.raises(DataError, match="q1, s1 could each be meant for the sliders"):
        open_log(saved(tmp_path, both), QUADRUPTERON)


@pytest.mark.parametrize(
    ("change", "what", "rows"), [(0.0, "is repeated", 100), (-0.5, "runs backward", 262_144)]
)
def test_time_that_does_not_rise_is_refused(tmp_path, change, what, rows):
    given = columns(motion())
    given["t"][200] = given["t"][199] + change * STEP
    file = saved(tmp_path, given)
    message = rf"row 201, column t: time {what} \({given['t'][200]:.12g} s behind 0\.199 s"
    with pytest.raises(DataError, match=message):
        list(open_log(file, QUADRUPTERON).pieces(rows))


@pytest.mark.parametrize("row", [200, 499])
@pytest.mark.parametrize("value", [1e308, -1e308, 1e18])
def test_times_too_large_for_their_steps_are_refused(tmp_path, row, value):
    given = columns(motion())
    given["t"][row] = value
    with pytest.raises(DataError, match=rf"row {row + 1}, column t: at .* digits cannot tell time"):
        open_log(saved(tmp_path, given), QUADRUPTERON).read()


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "mm"), (1e6, "um")])
def test_sliders_in_another_unit_are_refused_until_it_is_declared(tmp_path, factor, unit):
    log = motion()
    given = columns(log)
    for j in range(1, 5):
        given[f"rho{j}"] *= factor
    path = saved(tmp_path, given)
    with pytest.raises(DataError, match=rf'row 1, column rho1: .*\n\[joints\]\nunit = "{unit}"'):
        read_log(path, QUADRUPTERON)
    table = "joints" if unit == "mm" else "sliders"  # as older files say
    path.with_suffix(".toml").write_text(f'[{table}]\nunit = "{unit}"\n')
    back = read_log(path, QUADRUPTERON)
    np.testing.assert_allclose(back.joints, log.joints, rtol=1e-15)
    assert back.findings == ()


def test_metres_declared_to_be_millimetres_are_said(tmp_path):
    path = saved(tmp_path, columns(motion()), toml='[sliders]\nunit = "mm"\n')
    (finding,) = read_log(path, QUADRUPTERON).findings
    assert finding.kind == "units"
    assert "read as mm, travel at most" in finding.message


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "ms"), (1e6, "us")])
def test_time_in_another_unit_is_refused_until_it_is_declared(tmp_path, factor, unit):
    log = motion()
    path = saved(tmp_path, columns(log) | {"t": log.time * factor})
    with pytest.raises(DataError, match=rf'median step is .*\n\[time\]\nunit = "{unit}"'):
        read_log(path, QUADRUPTERON)
    path.with_suffix(".toml").write_text(f'[time]\nunit = "{unit}"\n')
    np.testing.assert_allclose(read_log(path, QUADRUPTERON).time, log.time, rtol=1e-15)
    path.with_suffix(".toml").write_text('[time]\nunit = "s"\n')
    np.testing.assert_array_equal(read_log(path, QUADRUPTERON).time, log.time * factor)


@pytest.mark.parametrize(("coordinate", "factor"), [("x", 1e3), ("phi", 180 / np.pi)])
def test_poses_in_another_unit_are_refused(tmp_path, coordinate, factor):
    log = motion()
    assert log.pose is not None
    pose = dict(zip(["x", "y", "z", "phi"], 5.0 * log.pose.T, strict=True))
    pose[coordinate] = pose[coordinate] * factor
    path = saved(tmp_path, columns(log) | pose)
    with pytest.raises(DataError, match=rf"row \d+, column {coordinate}: .*\n\[pose\]\n"):
        read_log(path, QUADRUPTERON)
    path.with_suffix(".toml").write_text('[pose]\nlength_unit = "mm"\nangle_unit = "deg"\n')
    back = read_log(path, QUADRUPTERON).pose
    assert back is not None
    scale = [1e-3, 1e-3, 1e-3, np.pi / 180]
    np.testing.assert_allclose(back, np.column_stack(list(pose.values())) * scale, rtol=1e-14)


@pytest.mark.parametrize(("column", "rows"), [("rho2", 60), ("force3", 262_144)])
def test_a_dead_channel_is_refused(tmp_path, column, rows):
    path = saved(tmp_path, columns(motion()) | {column: np.full(500, 0.1)})
    message = rf"motion\.csv: column {column} holds 0\.1 in all 500 rows: dead channel"
    with pytest.raises(DataError, match=message):
        list(open_log(path, QUADRUPTERON).pieces(rows))


def test_a_second_mass_in_the_payloads_column_is_refused(tmp_path):
    masses = np.repeat([0.0, 2.0, 3.0], [400, 50, 50])
    given = columns(motion()) | {"payload": masses}
    with pytest.raises(DataError, match=r"row 451, column payload: 3 given; 0 .*or one mass"):
        read_log(saved(tmp_path, given), QUADRUPTERON)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("motion.csv", None, "no such file"),
        ("motion.txt", b"", "unknown ending '.txt'; a log's file ends in .csv or .parquet"),
        ("motion.csv", b"", "is empty"),
        ("motion.csv", b"t;rho1\n1;2\n", "the columns rho1 are for 1 sliders"),
        ("motion.csv", b"\xff\xfet", "not UTF-16"),
        ("motion.csv", b"\x89PNG\0\n", "not UTF-8 text"),
        ("motion.parquet", b"t,rho1\n", "not a Parquet file"),
    ],
)
def test_what_is_no_log_is_refused(tmp_path, name, content, words):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(DataError, match=words):
        read_log(tmp_path / name, QUADRUPTERON)


DECLARED = """
[time]
column = "zeit"
unit = "ms"
[sliders]
columns = ["a", "b", "c", "d"]
unit = "mm"
[forces]
columns = ["e", "f", "g", "h"]
unit = "A"
gains = [10.0, -20, 30.0, 40.0]
limits = [-1000.0, 1000.0]
[pose]
columns = ["u", "v", "w", "r"]
length_unit = "mm"
angle_unit = "deg"
[payload]
column = "load"
mass = 0.5
center_of_mass = [0.02, -0.01]
inertia = 0.001
[motion]
period = 0.25
assembly_mode = 2
[drives]
rotor_inertia = [1e-5, 1e-5, 2e-5, 2e-5]
ratio = [300.0, 300.0, -300.0, 300.0]
"""


def test_declared_columns_units_and_gains_are_taken(tmp_path):
    log = motion()
    assert log.pose is not None
    given = {"zeit": log.time * 1e3, "note": ["text"] * 500, "load": log.payload}
    given |= dict(zip("abcd", 1e3 * log.joints.T, strict=True))
    given |= dict(zip("efgh", log.forces.T, strict=True))
    given |= dict(zip("uvwr", (log.pose * [1e3, 1e3, 1e3, 180 / np.pi]).T, strict=True))
    path = saved(tmp_path, given, toml=DECLARED)
    assert find_description(path) == path.with_suffix(".toml")
    back = read_log(path, QUADRUPTERON)
    for key in ("time", "joints", "pose", "payload"):
        np.testing.assert_allclose(getattr(back, key), getattr(log, key), rtol=1e-14)
    np.testing.assert_array_equal(back.forces, log.forces * [10.0, -20.0, 30.0, 40.0])
    about = back.description
    assert (about.force_unit, about.period, about.assembly_mode) == ("N", 0.25, 2)
    assert about.payload == KnownPayload(0.5, (0.01, -0.005), 0.001)
    assert about.ratio == (300.0, 300.0, -300.0, 300.0)
    assert back.findings == ()


def test_one_description_serves_all_logs_of_a_folder(tmp_path):
    """Logs that have one of their own keep it; a machine's file is none."""
    write_description(Description(column_force_unit="N"), tmp_path / "logs.toml")
    pteron.save(pteron.load("tripteron"), tmp_path / "machine.toml")
    write_description(Description(), tmp_path / "own.toml")
    for name, expected in (("a", "logs"), ("b", "logs"), ("own", "own"), ("machine", "logs")):
        found = find_description(tmp_path / f"{name}.csv")
        assert found == tmp_path / f"{expected}.toml"


def test_a_description_is_written_and_read_back(tmp_path):
    path = tmp_path / "motion.toml"
    path.write_text(DECLARED)
    given = read_description(path)
    assert read_description(write_description(given, tmp_path / "copy.toml")) == given
    empty = write_description(Description(), tmp_path / "empty.toml")
    assert read_description(empty) == Description()
    limits = Description(limits=((-1.0, 1.0), (-2.0, 3.0)), payload=KnownPayload(1.5))
    assert read_description(write_description(limits, path)) == limits


def test_a_description_is_given_by_value_or_path(tmp_path):
    log = motion()
    path = write_log(log, tmp_path / "motion.csv")
    other = write_description(Description(gains=(2.0,) * 4), tmp_path / "other.toml")
    assert find_description(path) is None
    for description in (other, str(other), read_description(other)):
        back = read_log(path, QUADRUPTERON, description=description)
        np.testing.assert_array_equal(back.forces, 2.0 * log.forces)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "[force]\n",
            "force: unknown key; did you mean forces[?] The valid ones there are csv, time, ",
        ),
        ("forces = 3\n", "forces: 3 given, a table expected"),
        ("[forces]\nunits = 'N'\n", "forces.units: unknown key; .* columns, unit, gains, limits"),
        (
            "[sliders]\nunit = 'cm'\n",
            "joints.unit: 'cm' given, 'm', 'mm', 'um', 'rad', 'deg', 'turns' or 'counts' expected",
        ),
        (
            "[joints]\nunit = 'deg'\n",
            "joints.unit: deg given, but .* it is one of m, mm, um, turns, counts$",
        ),
        ("[joints]\n[sliders]\n", "older name"),
        (
            "[forces]\ngains = [1, 'x', 1, 1]\n",
            "forces.gains, item 2: 'x' given, a number expected",
        ),
        ("[forces]\ngains = [1, 0, 1, 1]\n", "forces.gains, item 2: 0 given: its motor would not"),
        ("[forces]\ngains = [1, 2]\n", "forces.gains: 2 given, but the machine has 4 legs"),
        ("[forces]\nunit = 'N m'\n", "forces.unit: N m given, but .* it is one of A, V, %, N$"),
        ("[forces]\nlimits = [1, -1]\n", "forces.limits, item 1: 1 is not below -1"),
        ("[forces]\nlimits = [[-1, 1], [-1, 1]]\n", "forces.limits: 2 pairs given"),
        ("[pose]\ncolumns = ['x']\n", "pose.columns: 1 given, .*4 pose coordinates"),
        ("[joints]\ncolumns = ['a','b','c','d']\n", r"no column a, b, c, d, which .*\[joints\]"),
        ("[time]\ncolumn = 'a'\n[payload]\ncolumn = 'a'\n", "columns: 'a' is named twice"),
        ("[motion]\nperiod = 0\n", "motion.period: 0 given, a number above 0 expected"),
        (
            "[motion]\nassembly_mode = 0\n",
            "motion.assembly_mode: 0 given, a number of at least 1 exp",
        ),
        (
            "[drives]\nrotor_inertia = [-1, 1, 1, 1]\n",
            "item 1: -1 given, a number of at least 0 exp",
        ),
        ("[payload]\nmass = 1\n", "only its mass is given, but the machine turns"),
        ("[payload]\nmass = 1\ninertia = 1\n", "neither center_of_mass nor first_moment given"),
        ("[payload]\nmass = 1\nfirst_moment = [1, 0]\n", "payload: inertia is missing"),
        ("[payload]\nmass = 1\nfirst_moment = [1, 0]\ninertia = 0.5\n", "no real body"),
        ("[payload]\nmas = 1\n", r"payload.mas: unknown key; .*mass, first_moment"),
        ("[csv]\nseparator = ','\ndecimal = ','\n", "csv: decimal: .* cannot be the separator too"),
        ("[csv]\nsep = ';'\n", "csv.sep: unknown key; the valid ones there are separator, decimal"),
        ("[csv]\nencoding = 'klingon'\n", "csv: encoding: 'klingon' is no text encoding"),
        ("[payload\n", "not a TOML file"),
    ],
)
def test_a_wrong_description_is_refused_with_its_key(tmp_path, text, words):
    path = saved(tmp_path, columns(motion()), toml=text)
    with pytest.raises(DataError, match=words) as caught:
        open_log(path, QUADRUPTERON)
    assert "motion.toml" in str(caught.value) or "description's" in str(caught.value)


def test_all_faults_of_a_description_are_told_at_once(tmp_path):
    (tmp_path / "motion.toml").write_text(
        "[forces]\ngain = 1\n[motion]\nperiod = '4 s'\nmode = 1\n"
    )
    with pytest.raises(DataError) as caught:
        read_description(tmp_path / "motion.toml")
    assert [line.strip().partition(":")[0] for line in str(caught.value).splitlines()[1:]] == [
        "motion.period",
        "forces.gain",
        "motion.mode",
    ]


def test_a_description_in_python_is_checked_too():
    with pytest.raises(DataError, match=r"period: -1\.0 given, a number above 0 expected"):
        Description(period=-1.0)
    with pytest.raises(DataError, match=r"mass: -1\.0 given"):
        KnownPayload(-1.0)
    about = Description(joint_unit="mm", period=4.0)
    assert replace(about, period=None) == Description(joint_unit="mm")


def test_the_file_of_a_robot_is_no_description_of_a_log(tmp_path):
    path = write_log(motion(), tmp_path / "my.csv")
    pteron.save(QUADRUPTERON, tmp_path / "my.toml")
    assert find_description(path) is None
    assert read_log(path, QUADRUPTERON).rows == 500
    with pytest.raises(DataError, match="describes a manipulator; the description of a log was"):
        read_log(path, QUADRUPTERON, description=tmp_path / "my.toml")


# Dialects of CSV -----------------------------------------------------------------------------


def in_german(path: Path, encoding: str = "latin-1") -> None:
    """Write a log's file anew with semicolons, decimal commas, lines above it and an umlaut."""
    text = path.read_text().replace(",", ";").replace(".", ",").replace("t;", "Zeit für s;", 1)
    path.write_bytes(f"Maschine 7\n;;;\n{text}".encode(encoding))


SAID = """
[csv]
separator = ";"
decimal = ","
encoding = "{}"
header_lines = 3
[time]
column = "Zeit für s"
"""


@pytest.mark.parametrize("encoding", ["latin-1", "utf-16"])
def test_a_declared_dialect_is_read_to_the_last_digit(tmp_path, encoding):
    log = motion()
    path = write_log(log, tmp_path / "motion.csv")
    in_german(path, encoding)
    path.with_suffix(".toml").write_text(SAID.format(encoding), encoding="utf-8")
    assert_same(log, read_log(path, QUADRUPTERON))
    text = path.read_bytes().decode(encoding).replace("0,004;", "0.004;", 1)
    path.write_bytes(text.encode(encoding))
    words = r"row 5 \(line 8\), .*'0\.004' given, a number with a decimal comma expected"
    with pytest.raises(DataError, match=words):
        read_log(path, QUADRUPTERON)


def test_escape_codes_in_a_name_do_not_reach_the_terminal(tmp_path):
    given = columns(motion()) | {"\x1b[31mred" + "x" * 500: np.zeros(500)}
    del given["force4"]
    path = saved(tmp_path, given, "mo\x1btion.csv")
    with pytest.raises(DataError) as caught:
        open_log(path, QUADRUPTERON)
    message = str(caught.value)
    assert message.replace("\n", "").isprintable()
    assert r"mo\x1btion.csv" in message
    assert len(message) < 900


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"forces": np.zeros((9, 3))}, r"forces of shape \(9, 3\) given, \(10, n\)"),
        ({"joints": np.zeros((10, 3))}, r"joints of shape \(10, 3\) and forces of shape \(10, 2\)"),
        ({"joints": np.zeros(10)}, r"joints of shape \(10,\) given, \(10, n\) expected"),
        ({"time": np.zeros((10, 1))}, r"time of shape \(10, 1\) given, \(T,\) expected"),
        ({"time": [0.1 * i for i in range(9)] + [np.nan]}, "row 10, time: a finite number"),
        ({"time": np.zeros(10)}, "row 2: the time does not rise here"),
        ({"joints": [[0.0, 0.0]] * 4 + [[0.0, np.nan]] + [[0.0, 0.0]] * 5}, "row 5, joints: a fin"),
        ({"payload": np.zeros(3, int)}, r"payload of shape \(3,\) given, \(10,\) expected"),
        ({"joints": "abc"}, "joints: not an array of real numbers"),
    ],
)
def test_arrays_of_a_log_fit_together(changed, told):
    arrays = {"time": 0.1 * np.arange(10), "joints": np.zeros((10, 2)), "forces": np.zeros((10, 2))}
    assert len(Log("arrays", **arrays)) == 10
    as_lists = {name: values.tolist() for name, values in arrays.items()}
    assert Log("arrays", **as_lists).joints.shape == (10, 2)
    with pytest.raises(DataError, match=told) as caught:
        Log("arrays", **arrays | changed)
    assert str(caught.value).startswith("arrays: ")


@pytest.mark.parametrize("rows", [1, 5, 10, 15, 30])
def test_a_log_of_a_few_rows_is_refused_in_words(rows):
    rng = np.random.default_rng(0)
    log = Log("log", 1e-3 * np.arange(rows), *rng.normal(size=(2, rows, 3)))
    with pytest.raises(DataError, match="record longer"):
        identify("linear-delta", log)


def test_no_log_and_logs_of_other_machines_are_refused_in_words():
    with pytest.raises(DataError, match="logs: none given"):
        identify("linear-delta", [])
    for legs in (2, 4):
        log = Log("log", 1e-3 * np.arange(500), *np.zeros((2, 500, legs)))
        with pytest.raises(DataError, match=f"{legs} legs"):
            identify("linear-delta", log)


def test_a_name_with_thousands_of_digits_is_no_joint():
    assert parse_column_name("q12").number == 12
    assert parse_column_name("q" + "1" * 5000) is None


@pytest.mark.parametrize("name", ["time", "joints", "forces", "pose", "payload"])
def test_masked_values_are_refused(name):
    log = motion()
    values = np.ma.array(getattr(log, name))
    assert type(getattr(replace(log, **{name: values}), name)) is np.ndarray
    values[7] = np.ma.masked
    with pytest.raises(DataError, match=rf"made: \d values of {name} are masked; leave their rows"):
        replace(log, **{name: values})


# Cranks --------------------------------------------------------------------------------------


# Of the machines' own lengths; the numbers of a log need not be a motion.
CRANKS = {"delta": (0, 1, 2), "mixed": (1, 2)}
each_machine = pytest.mark.parametrize("name", CRANKS)


@each_machine
def test_the_columns_of_cranks_are_angles_and_torques(tmp_path, name):
    robot, turned = machine(name), CRANKS[name]
    log = replace(motion(TRIPTERON, pose=False), symbols=joint_symbols(robot))
    path = write_log(log, tmp_path / "motion.csv")
    stems = ["theta" if j in turned else "rho" for j in range(3)]
    header = path.read_text().partition("\n")[0].split(",")
    assert header[1:4] == [f"{stem}{j + 1}" for j, stem in enumerate(stems)]
    assert header[4 + turned[-1]] == f"torque{turned[-1] + 1}"
    back = read_log(path, robot)
    assert_same(log, back)
    assert (back.findings, back.description.force_unit) == ((), "N")
    assert_same(log, read_log(write_log(back, tmp_path / "copy.parquet"), robot))
    with pytest.raises(DataError, match=r"for (the|1) sliders.*needed: t, rho1, rho2, rho3"):
        read_log(path, TRIPTERON)


def test_degrees_are_found_by_name_and_told_by_size(tmp_path):
    robot = machine("mixed")
    log = motion(TRIPTERON, pose=False, payload=False)
    log = replace(log, joints=log.joints * [1.0, 20.0, 20.0])
    given = {"t": log.time, "rho1": log.joints[:, 0]}
    given |= {f"theta{j + 1} (deg)": np.degrees(log.joints[:, j]) for j in (1, 2)}
    given |= {"force1": log.forces[:, 0]}
    given |= {f"torque{j + 1}_Nm": log.forces[:, j] for j in (1, 2)}
    back = read_log(saved(tmp_path, given), robot)
    np.testing.assert_allclose(back.joints, log.joints, rtol=1e-14)
    (finding,) = back.findings
    assert (
        "joints rho1, theta2 (deg), theta3 (deg) in m and deg, forces force1, " in finding.message
    )
    plain = renamed(given, {f"theta{j} (deg)": f"theta{j}" for j in (2, 3)})
    path = saved(tmp_path, plain)
    words = r'column theta2: .* rad, read as rad, is over two turns; .*\n\[joints\]\nunit = "deg"'
    with pytest.raises(DataError, match=words):
        read_log(path, robot)
    for declared in ('unit = "deg"', 'unit = "m"\nangle_unit = "deg"'):
        path.with_suffix(".toml").write_text(f"[joints]\n{declared}\n")
        np.testing.assert_allclose(read_log(path, robot).joints, log.joints, rtol=1e-14)


@pytest.mark.parametrize("name", ["five-bar", "3-rrr", "delta-4"])
def test_poses_have_the_names_of_the_machine(tmp_path, name):
    robot = machine(name)
    n = robot.freedom
    log = replace(motion(TRIPTERON if n == 3 else QUADRUPTERON, rows=200), symbols=None)
    log = replace(
        log,
        joints=log.joints[:, :n],
        forces=log.forces[:, :n],
        pose=log.pose[:, :n],
        symbols=joint_symbols(robot),
        coordinates=robot.coordinates,
    )
    path = write_log(log, tmp_path / "motion.csv")
    header = path.read_text().partition("\n")[0].split(",")
    assert header[1 + 2 * n : -1] == list(robot.coordinates)
    assert header[1 : 1 + 2 * n] == [f"{w}{i + 1}" for w in ("theta", "torque") for i in range(n)]
    back = read_log(path, robot)
    assert back.coordinates == robot.coordinates
    assert_same(log, back)


def test_a_shaft_may_turn_without_end(tmp_path):
    robot = machine("delta-4")
    log = replace(motion(), symbols=joint_symbols(robot))
    turns = np.linspace(0.0, 40.0, log.rows)
    log = replace(log, joints=np.column_stack([log.joints[:, :3], turns]))
    log = replace(log, pose=np.column_stack([log.pose[:, :3], turns]))
    np.testing.assert_array_equal(
        read_log(write_log(log, tmp_path / "a.csv"), robot).joints, log.joints
    )
    cranks = replace(log, joints=log.joints[:, [3, 0, 1, 2]])
    with pytest.raises(DataError, match=r"theta1.* is over two turns"):
        read_log(write_log(cranks, tmp_path / "b.csv"), robot)


def test_a_currents_unit_holds_for_all_joints(tmp_path):
    robot = machine("mixed")
    log = replace(motion(TRIPTERON, pose=False), symbols=joint_symbols(robot))
    log = replace(log, description=Description(column_force_unit="A"))
    path = write_log(log, tmp_path / "motion.csv")
    assert read_log(path, robot).description.force_unit == "A"
    path.write_text(path.read_text().replace("current1", "force1", 1))
    with pytest.raises(
        DataError, match="are in N, A, A; give all in their SI units, or all in one"
    ):
        read_log(path, robot)


# Guesses and findings ------------------------------------------------------------------------


TIMES = {1.0: "s", 1e3: "ms", 1e6: "us"}


@pytest.mark.parametrize(
    ("time", "slider", "force", "scales", "unit"),
    [
        ("time", "q{}", "F{}", (1.0, 1.0), "N"),
        ("T", "Rho{}", "Force_{}", (1.0, 1.0), "N"),
        ("t_ms", "rho{}_mm", "tau{}", (1e3, 1e3), "N"),
        ("time (us)", "rho{} (um)", "I{}", (1e6, 1e6), "A"),
        ("Time [s]", "s{} [mm]", "force{} (%)", (1.0, 1e3), "%"),
    ],
)
def test_usual_variants_of_names_are_guessed_and_said(tmp_path, time, slider, force, scales, unit):
    log = motion()
    given = {time: log.time * scales[0]}
    given |= {slider.format(j + 1): log.joints[:, j] * scales[1] for j in range(4)}
    given |= {force.format(j + 1): log.forces[:, j] for j in range(4)}
    back = read_log(saved(tmp_path, given), QUADRUPTERON)
    np.testing.assert_allclose(back.time, log.time, rtol=1e-15)
    np.testing.assert_allclose(back.joints, log.joints, rtol=1e-15)
    np.testing.assert_array_equal(back.forces, log.forces)
    assert back.description.force_unit == unit
    (finding,) = back.findings
    assert finding.kind == "read"
    assert f"time {time} in {TIMES[scales[0]]}" in finding.message
    assert f"joints {slider.format(1)}, " in finding.message
    assert f" in {unit}; columns are taken by name" in finding.message


def test_documented_currents_need_no_guess(tmp_path):
    names = {f"force{j}": f"current{j}" for j in range(1, 5)}
    log = read_log(saved(tmp_path, renamed(columns(motion()), names)), QUADRUPTERON)
    assert log.description.force_unit == "A"
    assert log.findings == ()


def test_a_unit_declared_against_a_name_is_said(tmp_path):
    names = {f"rho{j}": f"rho{j}_mm" for j in range(1, 5)}
    path = saved(tmp_path, renamed(columns(motion()), names), toml='[sliders]\nunit = "m"\n')
    kinds = [finding.kind for finding in read_log(path, QUADRUPTERON).findings]
    assert kinds == ["read", "units"]


def test_a_guessed_name_is_said_with_the_unit_declared(tmp_path):
    log = motion()
    names = {f"rho{j}": f"q{j}" for j in range(1, 5)}
    given = renamed(columns(log), names)
    given |= {name: 1e3 * given[name] for name in names.values()}
    path = saved(tmp_path, given, toml='[sliders]\nunit = "mm"\n')
    back = read_log(path, QUADRUPTERON)
    np.testing.assert_allclose(back.joints, log.joints, rtol=1e-15)
    (finding,) = back.findings
    assert "read as: joints q1, q2, q3, q4 in mm; columns are taken by name" in finding.message


def test_guessed_poses_and_lone_coordinates_are_said(tmp_path):
    log = motion()
    assert log.pose is not None
    names = ["X (mm)", "Y (mm)", "Z (mm)", "phi_deg"]
    scaled = log.pose * [1e3, 1e3, 1e3, 180 / np.pi]
    given = columns(log) | dict(zip(names, scaled.T, strict=True))
    back = read_log(saved(tmp_path, given), QUADRUPTERON)
    np.testing.assert_allclose(back.pose, log.pose, rtol=1e-14)
    assert "mm and deg" in back.findings[0].message
    back = read_log(saved(tmp_path, columns(log) | {"x": log.time}), QUADRUPTERON)
    assert back.pose is None
    assert "x alone are no pose" in back.findings[0].message


def faulty(rows=6000) -> dict[str, np.ndarray]:
    """Return a log with gaps, a frozen slider and clipped forces across the pieces' borders."""
    given = columns(motion(rows=rows))
    given["rho2"][1500:3200] = given["rho2"][1500]
    given["rho2"][4000:5500] = given["rho2"][4000]
    given["force1"] = np.minimum(given["force1"], 15.0)
    given["force3"] = np.clip(given["force3"], -12.0, None)
    given["t"][1999:] += 3 * STEP
    given["t"][4500:] += 1 * STEP
    given["t"][700] += 0.2 * STEP
    return given


def test_gaps_jitter_frozen_and_clipped_channels_are_found(tmp_path):
    given = faulty()
    log = read_log(saved(tmp_path, given), QUADRUPTERON)
    found = {(finding.kind, finding.column): finding for finding in log.findings}
    assert set(found) == {
        ("gap", "t"),
        ("jitter", "t"),
        ("frozen", "rho2"),
        ("clipped", "force1"),
        ("clipped", "force3"),
    }
    gap = found["gap", "t"]
    assert (gap.row, gap.count) == (2000, 2)
    assert "2 gaps, 4 samples missing in all; the first is before row 2000" in gap.message
    assert "3 missing (a step of 0.004 s where 0.001 s is usual)" in gap.message
    jitter = found["jitter", "t"]
    assert jitter.count == 2
    assert jitter.row in (701, 702)
    assert "20.0%" in jitter.message
    frozen = found["frozen", "rho2"]
    assert (frozen.row, frozen.count) == (1501, 2)
    assert "in rows 1501 to 3200 while" in frozen.message
    at_limit = given["force1"] == 15.0
    assert found["clipped", "force1"].count <= at_limit.sum()
    assert found["clipped", "force1"].count > 0.8 * at_limit.sum()
    assert log.segments == (slice(0, 1999), slice(1999, 4500), slice(4500, 6000))


@pytest.mark.parametrize(
    ("ending", "rows"),
    [(".csv", rows) for rows in (3, 97, 1999, 3200)] + [(".parquet", 1700)],
)
def test_findings_do_not_depend_on_the_pieces(tmp_path, ending, rows):
    path = saved(tmp_path, faulty(), f"motion{ending}")
    file = open_log(path, QUADRUPTERON)
    list(file.pieces(rows))
    assert file.findings == read_log(path, QUADRUPTERON).findings
    assert len(file.findings) == 5


def test_declared_limits_decide_what_is_clipped(tmp_path):
    given = faulty()
    limits = "[[-100, 15], [-100, 100], [-12, 100], [-100, 100]]"
    path = saved(tmp_path, given, toml=f"[forces]\nlimits = {limits}\n")
    found = [f for f in read_log(path, QUADRUPTERON).findings if f.kind == "clipped"]
    assert [(f.column, f.count, f.row) for f in found] == [
        (name, int(at.sum()), int(np.argmax(at)) + 1)
        for name, at in (
            ("force1", given["force1"] == 15.0),
            ("force3", given["force3"] == -12.0),
        )
    ]


def test_single_samples_that_stand_out_are_found(tmp_path):
    given = columns(motion(rows=4000))
    rng = np.random.default_rng(0)
    for j in range(1, 5):
        given[f"force{j}"] += 0.05 * np.ptp(given[f"force{j}"]) * rng.normal(size=4000)
        given[f"rho{j}"] = np.round(given[f"rho{j}"], 6)
    assert read_log(saved(tmp_path, given), QUADRUPTERON).findings == ()
    given["rho2"][1200] += 0.3 * np.ptp(given["rho2"])
    given["force3"][[700, 3000]] += 5.0 * np.ptp(given["force3"])
    found = read_log(saved(tmp_path, given), QUADRUPTERON).findings
    assert [(f.kind, f.column, f.row, f.count) for f in found] == [
        ("spike", "rho2", 1201, 1),
        ("spike", "force3", 701, 2),
    ]
    assert "rows 701, 3001, column force3: spikes of 2 samples" in found[1].message


def test_a_machine_at_rest_is_not_frozen(tmp_path):
    given = columns(motion(rows=4000))
    for j in range(1, 5):
        given[f"rho{j}"][1000:2500] = given[f"rho{j}"][1000]
    assert read_log(saved(tmp_path, given), QUADRUPTERON).findings == ()


def test_jitter_below_half_a_step_makes_no_gap(tmp_path):
    given = columns(motion())
    given["t"] += np.random.default_rng(3).uniform(-0.2, 0.2, 500) * STEP
    log = read_log(saved(tmp_path, given), QUADRUPTERON)
    assert [finding.kind for finding in log.findings] == ["jitter"]
    assert log.segments == (slice(0, 500),)
