"""Dialects of logs: each is read to the numbers of the plain file, or refused with what to say."""

from __future__ import annotations

import re
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from mechanisms import CATALOG

from pteron.errors import DataError
from pteron.identification.logs import Log, joint_symbols, open_log, read_log
from pteron.identification.logs.clock import find_clock
from pteron.tables import Table

MACHINES = ("quadrupteron", "delta", "par4", "five-bar")
each_machine = pytest.mark.parametrize("name", MACHINES)
ROWS = 60
STEP_MS = 2


class Sheet:
    """The cells of a log of a machine, as text with decimal points, and the log they make."""

    def __init__(self, name: str, *, millimetres: bool = False) -> None:
        self.robot = CATALOG[name]
        n = len(self.robot.legs)
        rng = np.random.default_rng(n)
        wave = np.sin(np.outer(np.arange(ROWS), rng.uniform(0.1, 0.2, n)) + rng.uniform(0, 6, n))
        self.sliders = self.robot.legs[0].joint.unit == "m"
        self.scale = 1000.0 if millimetres and self.sliders else 1.0
        self.joints = [[f"{0.05 * self.scale * v:.6f}" for v in row] for row in wave]
        self.forces = [[f"{20.0 * v - 3.0:.4f}" for v in row] for row in wave]
        self.milliseconds = [STEP_MS * i for i in range(ROWS)]

    def rows(self, times: list[str], *, decimal: str = ".") -> list[list[str]]:
        return [
            [t, *(v.replace(".", decimal) for v in (*q, *f))]
            for t, q, f in zip(times, self.joints, self.forces, strict=True)
        ]

    def names(self, time: str, joint: str, force: str, first: int = 1) -> list[str]:
        legs = range(first, first + len(self.robot.legs))
        return [time, *(joint.format(i) for i in legs), *(force.format(i) for i in legs)]

    def check(self, log: Log, *, start: float = 0.0) -> None:
        """Compare a log with the numbers that its cells are, to the last digit."""
        joints = np.array(self.joints, dtype=float)
        np.testing.assert_array_equal(log.joints, joints / self.scale)
        np.testing.assert_array_equal(log.forces, np.array(self.forces, dtype=float))
        # Sums of days and fractions of seconds round once.
        ticks = np.array(self.milliseconds) / 1e3
        np.testing.assert_allclose(log.time - start, ticks, rtol=0, atol=1e-15 + 2e-16 * start)
        assert log.symbols == joint_symbols(self.robot)


def written(folder: Path, rows: list[list[str]], separator: str = ",", **options: str) -> Path:
    """Write rows of cells below other lines, in an encoding and with the line ends of Windows."""
    path = folder / "motion.csv"
    lines = [options[key] for key in ("above",) if key in options]
    lines += [separator.join(row) for row in rows]
    lines += [options[key] for key in ("below",) if key in options]
    text = "\r\n".join(lines) + "\r\n"
    path.write_bytes(text.encode(options.get("encoding", "utf-8")))
    return path


def message(log: Log) -> str:
    (finding,) = (one for one in log.findings if one.kind == "read")
    return finding.message.partition("read as: ")[2]


def seconds(sheet: Sheet) -> list[str]:
    return [f"{t / 1e3:.3f}" for t in sheet.milliseconds]


# How the cells are written ---------------------------------------------------------------------


@each_machine
@pytest.mark.parametrize(
    ("separator", "decimal"),
    [
        (",", "."),
        (";", "."),
        (";", ","),
        ("\t", "."),
        ("\t", ","),
        ("|", ","),
        (" ", "."),
        (" ", ","),
    ],
)
def test_separators_and_decimal_signs_are_found(tmp_path, name, separator, decimal):
    sheet = Sheet(name)
    joint, force = ("rho{}", "force{}") if sheet.sliders else ("theta{}", "torque{}")
    times = [t.replace(".", decimal) for t in seconds(sheet)]
    rows = sheet.rows(times, decimal=decimal)
    log = read_log(
        written(tmp_path, [sheet.names("t", joint, force), *rows], separator), sheet.robot
    )
    sheet.check(log)
    if (separator, decimal) == (",", "."):
        assert log.findings == ()
        return
    assert ("decimal comma" in message(log)) == (decimal == ",")
    assert ("separated by" in message(log)) == (separator != ",")


@pytest.mark.parametrize(
    ("encoding", "told"),
    [
        ("utf-8-sig", None),
        ("utf-16", "encoding utf-16"),
        ("utf-16-be", "encoding utf-16"),
        ("cp1252", "encoding cp1252 (guessed: it is not UTF-8)"),
    ],
)
def test_encodings_are_found(tmp_path, encoding, told):
    sheet = Sheet("quadrupteron")
    names = [*sheet.names("t", "rho{}", "force{}"), "Temperatur °C für Öl"]
    rows = [[*row, "21.5"] for row in sheet.rows(seconds(sheet))]
    path = written(tmp_path, [names, *rows], encoding=encoding)
    if encoding == "utf-16-be":
        path.write_bytes(b"\xfe\xff" + path.read_bytes())
    log = read_log(path, sheet.robot)
    sheet.check(log)
    assert (message(log) == told) if told else (log.findings == ())


def test_utf_16_without_its_mark_is_refused_until_it_is_declared(tmp_path):
    sheet = Sheet("quadrupteron")
    names = sheet.names("t", "rho{}", "force{}")
    path = written(tmp_path, [names, *sheet.rows(seconds(sheet))], encoding="utf-16-le")
    refused_then_read(path, sheet, "not UTF-8 text")


def test_blanks_may_be_several(tmp_path):
    sheet = Sheet("delta")
    rows = [sheet.names("t", "theta{}", "torque{}"), *sheet.rows(seconds(sheet))]
    aligned = [["", *(cell.rjust(14) for cell in row)] for row in rows]
    sheet.check(read_log(written(tmp_path, aligned, " "), sheet.robot))


@each_machine
@pytest.mark.parametrize("brackets", ["{}", "[{}]", "({})"])
def test_a_line_of_units_below_the_names_is_found(tmp_path, name, brackets):
    sheet = Sheet(name, millimetres=True)
    n = len(sheet.robot.legs)
    units = ["ms", *["mm" if sheet.sliders else "rad"] * n, *["N" if sheet.sliders else "Nm"] * n]
    rows = [
        sheet.names("Time", "q{}", "tau{}"),
        [brackets.format(unit) for unit in units],
        *sheet.rows([str(t) for t in sheet.milliseconds]),
    ]
    log = read_log(written(tmp_path, rows, ";", above="Machine 7\r\nVersion;1.2\r\n"), sheet.robot)
    sheet.check(log)
    assert "5 header lines, units in a line of their own, time Time in ms" in message(log)
    if sheet.sliders:
        assert "q4 in mm, forces tau1, tau2, tau3, tau4 in N;" in message(log)


@pytest.mark.parametrize(
    "names",
    [
        ("Time/ms", "rho{}/mm", "force{}/N"),
        ("t (ms)", "rho{} [mm]", "force{} [N]"),
        ("time_ms", "q{}_mm", "tau_{}"),
    ],
)
def test_units_in_names(tmp_path, names):
    sheet = Sheet("quadrupteron", millimetres=True)
    rows = sheet.rows([str(t) for t in sheet.milliseconds])
    log = read_log(written(tmp_path, [sheet.names(*names), *rows]), sheet.robot)
    sheet.check(log)
    assert f"time {names[0]} in ms, joints {names[1].format(1)}, " in message(log)


def test_what_is_declared_is_not_found_again(tmp_path):
    sheet = Sheet("quadrupteron")
    rows = [["# t", "not these", *["x"] * 7], sheet.names("t", "rho{}", "force{}")]
    rows += sheet.rows([t.replace(".", ",") for t in seconds(sheet)], decimal=",")
    path = written(tmp_path, rows, ";")
    path.with_suffix(".toml").write_text(
        '[csv]\nseparator = ";"\ndecimal = ","\nheader_lines = 2\n'
    )
    log = read_log(path, sheet.robot)
    sheet.check(log)
    assert log.findings == ()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({0: "fast"}, r"row 1 \(line 2\), column t: 'fast' given, a number expected"),
        ({3: ""}, r"row 1 \(line 2\), column theta3: the cell is empty"),
        ({7: "0.5"}, r"row 1 \(line 2\) has 8 cells, but the header names 7"),
    ],
)
def test_a_first_row_with_a_fault_is_no_header(tmp_path, change, words):
    sheet = Sheet("delta")
    rows = sheet.rows(seconds(sheet))
    rows[0] = [change.get(i, cell) for i, cell in enumerate([*rows[0], ""])][: max(*change, 6) + 1]
    with pytest.raises(DataError, match=words):
        read_log(
            written(tmp_path, [sheet.names("t", "theta{}", "torque{}"), *rows], ";"), sheet.robot
        )


# Time ------------------------------------------------------------------------------------------

START = datetime(2026, 11, 22, 23, 59, 59, 940_000)


def stamps(sheet: Sheet, pattern: str) -> list[str]:
    """Return times as text; midnight passes within them."""
    return [(START + timedelta(milliseconds=t)).strftime(pattern)[:-3] for t in sheet.milliseconds]


@pytest.mark.parametrize(
    ("pattern", "separator", "form"),
    [
        ("%Y-%m-%d %H:%M:%S.%f", ",", "YYYY-MM-DD hh:mm:ss"),
        ("%Y-%m-%dT%H:%M:%S.%f", ",", "YYYY-MM-DD hh:mm:ss"),
        ("%d.%m.%Y %H:%M:%S,%f", ";", "DD.MM.YYYY hh:mm:ss"),
        ("%d.%m.%y %H:%M:%S.%f", ";", "DD.MM.YYYY hh:mm:ss"),
        ("%m/%d/%Y %H:%M:%S.%f", ",", "MM/DD/YYYY hh:mm:ss"),
        ("%H:%M:%S.%f", ",", "hh:mm:ss"),
        ("%H:%M:%S:%f", "\t", "hh:mm:ss"),
    ],
)
@pytest.mark.parametrize("rows", [7, 1 << 18])
def test_times_as_text_are_read_over_midnight(tmp_path, pattern, separator, form, rows):
    sheet = Sheet("quadrupteron")
    cells = [sheet.names("Time", "rho{}", "force{}"), *sheet.rows(stamps(sheet, pattern))]
    path = written(tmp_path, cells, separator)
    file = open_log(path, sheet.robot)
    pieces = list(file.pieces(rows))
    time = np.concatenate([piece.time for piece in pieces])
    assert time[0] == 86399.94
    np.testing.assert_allclose(time - time[0], np.array(sheet.milliseconds) / 1e3, atol=2e-11)
    assert f"time Time as text, {form}" in file.findings[0].message


def test_zones_and_halves_of_the_day_are_understood(tmp_path):
    sheet = Sheet("quadrupteron")
    times = [f"2026-11-22T11:59:59.{t + 800:03d}+01:00" for t in sheet.milliseconds]
    times[30:] = [t.replace("T11", "T12").replace("+01:00", "+02:00") for t in times[30:]]
    names = sheet.names("t", "rho{}", "force{}")
    sheet.check(
        read_log(written(tmp_path, [names, *sheet.rows(times)]), sheet.robot), start=39599.8
    )
    times = [f"22.11.2026 01:00:00.{t:03d} PM" for t in sheet.milliseconds]
    log = read_log(written(tmp_path, [names, *sheet.rows(times)]), sheet.robot)
    sheet.check(log, start=13 * 3600.0)


@pytest.mark.parametrize(("unit", "ticks"), [("us", 1000), ("ns", 1_000_000), ("100 ns", 10_000)])
def test_units_of_time_are_declared(tmp_path, unit, ticks):
    sheet = Sheet("five-bar")
    rows = sheet.rows([str(t * ticks) for t in sheet.milliseconds])
    path = written(tmp_path, [sheet.names("t", "theta{}", "torque{}"), *rows])
    path.with_suffix(".toml").write_text(f'[time]\nunit = "{unit}"\n')
    sheet.check(read_log(path, sheet.robot))


@pytest.mark.parametrize(
    ("origin", "ticks", "unit"),
    [
        (1_795_000_000_123, 1, "ms"),
        (1_795_000_000_123_456, 1000, "us"),
        (1_795_000_000_123_456_789, 1_000_000, "ns"),
        (134_000_000_012_345_678, 10_000, "100 ns"),
    ],
)
def test_dates_as_numbers_tell_their_unit_and_lose_no_digit(tmp_path, origin, ticks, unit):
    sheet = Sheet("delta")
    rows = sheet.rows([str(origin + t * ticks) for t in sheet.milliseconds])
    log = read_log(written(tmp_path, [sheet.names("t", "theta{}", "torque{}"), *rows]), sheet.robot)
    if unit in ("ns", "100 ns"):  # floats cannot hold them
        sheet.check(log)
    np.testing.assert_allclose(
        log.time - log.time[0], np.array(sheet.milliseconds) / 1e3, atol=1e-6
    )
    assert f"time t in {unit} (guessed from its size)" in message(log)


def test_dates_in_parquet_are_times(tmp_path):
    sheet = Sheet("delta")
    names = sheet.names("t", "theta{}", "torque{}")
    columns = np.array(sheet.rows(seconds(sheet)), dtype=float).T
    when = [START + timedelta(milliseconds=t) for t in sheet.milliseconds]
    frame = pl.DataFrame(dict(zip(names, columns, strict=True)) | {"t": when})
    frame.write_parquet(tmp_path / "a.parquet")
    sheet.check(read_log(tmp_path / "a.parquet", sheet.robot))


def test_midnight_passes_between_blocks_of_a_file():
    parts = [["23:59:59.9", "00:00:00.1"], ["00:00:00.3"], ["23:59:59.5"], ["00:00:00.5"]]
    tables = [Table("a.csv", pl.DataFrame({"t": cells})) for cells in parts]
    clock = find_clock(tables[0], ("t",), None, None)
    for _ in range(2):
        one = clock.fresh()
        found = np.concatenate([one.seconds(table) for table in tables])
        np.testing.assert_allclose(
            found, [86399.9, 86400.1, 86400.3, 172799.5, 172800.5], rtol=0, atol=1e-10
        )


# Layouts of programs ---------------------------------------------------------------------------


def scope(sheet: Sheet, *, shared: bool, stamps: int = 0) -> list[list[str]]:
    """Return an export of TwinCAT Scope, laid out as the CSV files that test the package pytcs.

    (github.com/CagtayFabry/pytcs, tests/data, Scope 3.4: tabs, keys above each column of times, a
    blank line, times in ms; Beckhoff's page on the export to csv tells of full stamps and of EOF.)
    """
    n = len(sheet.robot.legs)
    unit = ["mm (Length)" if sheet.sliders else "(None)"] * n + ["(None)"] * n
    channels = [f"Axis{i + 1}.{what}" for what in ("ActPos", "Torque") for i in range(n)]
    keys = {
        "Name": [c.replace("Torque", "ActForce" if sheet.sliders else "Torque") for c in channels],
        "SymbolComment": [""] * 2 * n,
        "Data-Type": ["REAL64"] * 2 * n,
        "SampleTime[ms]": [str(STEP_MS)] * 2 * n,
        "SymbolName": [f"MAIN.{c}" for c in channels],
        "NetID": ["192.168.178.20.1.1"] * 2 * n,
        "Port": ["851"] * 2 * n,
        "Unit": unit,
        "Unit Offset": ["0"] * 2 * n,
    }
    top = [
        ["Name", "motion"],
        ["File", "motion.csv"],
        ["Starttime of export", str(stamps), "Montag"],
    ]
    times = [str(stamps + t * (10_000 if stamps else 1)) for t in sheet.milliseconds]
    if shared:
        rows = sheet.rows(times, decimal=",")
        return [*top, [], [], *([k, *v] for k, v in keys.items()), [], *rows]
    pairs = [[part for value in v for part in (k, value)] for k, v in keys.items()]
    rows = [
        [part for value in row[1:] for part in (row[0], value)]
        for row in sheet.rows(times, decimal=",")
    ]
    return [*top, [], [], *pairs, [], *rows]


@each_machine
@pytest.mark.parametrize(
    ("shared", "stamps"), [(True, 0), (False, 0), (False, 132_959_733_843_760_000)]
)
def test_an_export_of_twincat_scope_is_read(tmp_path, name, shared, stamps):
    sheet = Sheet(name, millimetres=True)
    cells = scope(sheet, shared=shared, stamps=stamps)
    log = read_log(written(tmp_path, cells, "\t", below="EOF"), sheet.robot)
    sheet.check(log)
    told = message(log)
    assert told.startswith("cells separated by tabs, decimal comma, 15 header lines, time Time in ")
    assert (f"{2 * len(sheet.robot.legs)} equal columns of times" in told) == (not shared)


def test_channels_that_were_not_sampled_together_are_refused(tmp_path):
    sheet = Sheet("quadrupteron", millimetres=True)
    cells = scope(sheet, shared=False)
    cells[-20][4] = "81,5"
    with pytest.raises(
        DataError, match=r"row 41 \(line 56\): its channels were not sampled at one"
    ):
        read_log(written(tmp_path, cells, "\t"), sheet.robot)


def test_a_trace_of_codesys_2_is_read(tmp_path):
    """As the help of ABB Automation Builder shows a trace in an ASCII file: three lines, blanks."""
    sheet = Sheet("delta")
    names = sheet.names("Cycle", "PLC_PRG.theta{}", "PLC_PRG.torque{}")
    above = "CoDeSys Trace\r\nD:\\PROJECTS\\DELTA.PRO"
    rows = sheet.rows([str(t) for t in sheet.milliseconds])
    path = written(tmp_path, [names, *rows], " ", above=above)
    log = refused_then_read(path, sheet, "no columns for the time; .* the median step is 2 s")
    assert "cells separated by blanks, 3 header lines" in message(log)


def below_one_another(sheet):
    """Return the times, names and values of a sheet as variables one below another."""
    names = sheet.names("t", "PLC_PRG.theta{}", "PLC_PRG.torque{}")[1:]
    columns = zip(*[[*q, *f] for q, f in zip(sheet.joints, sheet.forces, strict=True)], strict=True)
    return sheet.milliseconds, list(zip(names, columns, strict=True))


def test_a_trace_of_codesys_3_is_read(tmp_path):
    """A block for each variable (github.com/ajwang-kajwang/sdplc reads them so)."""
    sheet = Sheet("delta")
    times, variables = below_one_another(sheet)
    lines = []
    for i, (name, values) in enumerate(variables):
        lines.append([f"{i}.Variable", f" {name}"])
        lines += [["", f" {t}.0", f" {v}"] for t, v in zip(times, values, strict=True)]
    path = written(tmp_path, lines, ";")
    log = refused_then_read(path, sheet, "the median step is 2 s")
    sheet.check(log)
    assert "variables one below another" in message(log)
    del lines[5]
    with pytest.raises(DataError, match=r"the times of PLC_PRG.theta2 are not those of .*theta1"):
        read_log(written(tmp_path, lines, ";"), sheet.robot)


def test_a_log_of_wincc_is_read(tmp_path):
    """A row for each value, times in days, as the help of WinCC shows a CSV file with tags."""
    sheet = Sheet("delta")
    times, variables = below_one_another(sheet)
    header = ["VarName", "TimeString", "VarValue", "Validity", "Time_ms"]
    days = [35886460322 + t / 86.4 for t in times]
    rows = [
        [name, "01.04.98 11:02:52", values[k].replace(".", ","), "1", f"{days[k]:.6f}"]
        for k in range(ROWS)
        for name, values in variables
    ]
    rows = [[cell.replace(".", ",") if i == 4 else cell for i, cell in enumerate(r)] for r in rows]
    cells = [[f'"{cell}"' for cell in row] for row in [header, *rows, ["$RT_OFF$", *4 * ["0"]]]]
    log = read_log(written(tmp_path, cells, ";"), sheet.robot)
    np.testing.assert_array_equal(log.joints, np.array(sheet.joints, dtype=float))
    np.testing.assert_array_equal(log.forces, np.array(sheet.forces, dtype=float))
    np.testing.assert_allclose(log.time, np.array(times) / 1e3, atol=1e-6)
    short = [row[:4] for row in cells]
    with pytest.raises(DataError, match="a row for each value, but no column Time_ms"):
        read_log(written(tmp_path, short, ";"), sheet.robot)


@each_machine
def test_messages_of_ros_as_rostopic_prints_them_are_read(tmp_path, name):
    """`rostopic echo -p` writes %time and the stamp in ns and counts from 0: field.position0."""
    sheet = Sheet(name)
    n = len(sheet.robot.legs)
    origin = 1_795_000_000_123_456_789
    names = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"]
    names += [
        f"field.{what}{i}" for what in ("name", "position", "velocity", "effort") for i in range(n)
    ]
    rows = []
    for i, (q, f) in enumerate(zip(sheet.joints, sheet.forces, strict=True)):
        stamp = origin + sheet.milliseconds[i] * 1_000_000
        rows.append([str(stamp + 217_003 + i), str(i), str(stamp), "base", *["joint"] * n, *q])
        rows[-1] += [*["0.0"] * n, *f]
    log = read_log(written(tmp_path, [names, *rows]), sheet.robot)
    sheet.check(log)
    assert "time field.header.stamp in ns (guessed from its size), joints field.pos" in message(log)


def test_stamps_of_ros_in_seconds_and_nanoseconds_are_read(tmp_path):
    """bagpy writes Time and header.stamp.secs, header.stamp.nsecs, and counts position_0."""
    sheet = Sheet("quadrupteron")
    names = ["Time", "header.seq", "header.stamp.secs", "header.stamp.nsecs"]
    names += sheet.names("", "position_{}", "effort_{}", first=0)[1:]
    rows = []
    for i, row in enumerate(sheet.rows(seconds(sheet))):
        nano = 999_000_000 + sheet.milliseconds[i] * 1_000_000
        stamp = [str(1_795_000_000 + nano // 10**9), str(nano % 10**9)]
        rows.append([f"{1_795_000_000 + nano / 1e9:.6f}", str(i), *stamp, *row[1:]])
    path = written(tmp_path, [names, *rows])
    log = read_log(path, sheet.robot)
    sheet.check(log)
    assert "time header.stamp.secs, header.stamp.nsecs in s" in message(log)
    path.with_suffix(".toml").write_text('[time]\ncolumn = "Time"\n')
    np.testing.assert_allclose(read_log(path, sheet.robot).time, [float(r[0]) for r in rows])


@pytest.mark.parametrize(
    ("time", "joint", "force"),
    [
        ("__time", "/joint_states/joint{}/position", "/joint_states/joint{}/effort"),
        ("time", "/joint_states/position[{}]", "/joint_states/effort[{}]"),
        ("Time [s]", "Axis {} Actual Position [m]", "Axis {} Actual Force [N]"),
        ("timestamp", "MAIN.Axis[{}].NcToPlc.ActPos", "MAIN.fForce[{}]"),
    ],
)
def test_names_of_other_programs(tmp_path, time, joint, force):
    """PlotJuggler writes __time and paths by joint; rqt_plot names paths by index."""
    sheet = Sheet("quadrupteron")
    path = written(tmp_path, [sheet.names(time, joint, force), *sheet.rows(seconds(sheet))])
    if "fForce" in force:
        refused_then_read(path, sheet, "no columns for the forces")
    else:
        sheet.check(read_log(path, sheet.robot))


# What could be read in two ways ----------------------------------------------------------------


def refused_then_read(path: Path, sheet: Sheet, words: str) -> Log | None:
    """Check that a file is refused, and read it with what the message says put into its TOML file.

    What is refused again, for another reason, returns None.
    """
    with pytest.raises(DataError, match=words) as caught:
        read_log(path, sheet.robot)
    declared = re.search(r"\n\[(\w+)\]\n(.*)\Z", str(caught.value), re.DOTALL)
    assert declared, str(caught.value)
    toml = path.with_suffix(".toml")
    before = toml.read_text() if toml.exists() else ""
    header = f"[{declared[1]}]\n"
    if header in before:
        toml.write_text(before.replace(header, header + declared[2] + "\n"), encoding="utf-8")
    else:
        toml.write_text(before + declared[0] + "\n", encoding="utf-8")
    try:
        log = read_log(path, sheet.robot)
    except DataError:
        return None
    sheet.check(log)
    return log


def test_thousands_or_decimals_are_asked_for(tmp_path):
    sheet = Sheet("quadrupteron", millimetres=True)
    sheet.joints = [[f"{20 + abs(float(v)):.3f}" for v in row] for row in sheet.joints]
    sheet.forces = [[f"{v:.3f}" for v in 100 + np.arange(4) + i / 8] for i in range(ROWS)]
    rows = sheet.rows([str(t) for t in sheet.milliseconds], decimal=",")
    path = written(tmp_path, [sheet.names("t [ms]", "rho{} [mm]", "force{}"), *rows], ";")
    assert (
        refused_then_read(path, sheet, r"'\d\d,\d{3}' may have a decimal comma or a mark of")
        is not None
    )


def test_marks_of_thousands_are_refused(tmp_path):
    sheet = Sheet("quadrupteron")
    rows = sheet.rows([t.replace(".", ",") for t in seconds(sheet)], decimal=",")
    rows[40][5] = "1.234,5"
    path = written(tmp_path, [sheet.names("t", "rho{}", "force{}"), *rows], ";")
    with pytest.raises(
        DataError, match=r"row 41 .*'1\.234,5' given, a number with a decimal comma"
    ):
        read_log(path, sheet.robot)


def test_commas_that_separate_cells_and_decimals_are_refused(tmp_path):
    sheet = Sheet("quadrupteron")
    rows = sheet.rows([t.replace(".", ",") for t in seconds(sheet)], decimal=",")
    path = written(tmp_path, [sheet.names("t", "rho{}", "force{}"), *rows], ",")
    with pytest.raises(DataError, match=r"line 1 has 9 cells .*the rows below have 18.*be decimal"):
        read_log(path, sheet.robot)


def test_day_or_month_first_is_asked_for(tmp_path):
    sheet = Sheet("quadrupteron")
    times = [f"03/04/2026 13:00:00.{t:03d}" for t in sheet.milliseconds]
    path = written(tmp_path, [sheet.names("t", "rho{}", "force{}"), *sheet.rows(times)])
    with pytest.raises(DataError, match="may have the day or the month first") as caught:
        read_log(path, sheet.robot)
    path.with_suffix(".toml").write_text(str(caught.value).partition("beside it:")[2])
    sheet.check(read_log(path, sheet.robot), start=13 * 3600.0)


def test_names_with_blanks_between_blanks_are_refused(tmp_path):
    sheet = Sheet("delta")
    rows = sheet.rows(seconds(sheet))
    names = sheet.names("t", "Axis {} Actual Position", "torque{}")
    with pytest.raises(DataError, match=r"line 1 has 16 cells .*have 7, separated by blanks"):
        read_log(written(tmp_path, [names, *rows], " "), sheet.robot)
    rows[30].pop()
    names = sheet.names("t", "theta{}", "torque{}")
    with pytest.raises(DataError, match=r"row 31 \(line 32\) has 6 cells.*blanks cannot mark"):
        read_log(written(tmp_path, [names, *rows], " "), sheet.robot)


def test_two_columns_that_could_be_meant_are_asked_for(tmp_path):
    sheet = Sheet("quadrupteron")
    names = [*sheet.names("t", "q{}", "force{}"), "s1", "s2", "s3", "s4"]
    rows = [[*row, *row[1:5]] for row in sheet.rows(seconds(sheet))]
    path = written(tmp_path, [names, *rows])
    assert refused_then_read(path, sheet, "q1, s1 could each be meant for the sliders") is not None


def test_a_unit_against_the_size_of_the_numbers_is_refused(tmp_path):
    sheet = Sheet("quadrupteron")
    names = sheet.names("t", "rho{} [mm]", "force{}")
    path = written(tmp_path, [names, *sheet.rows(seconds(sheet))])
    assert refused_then_read(path, sheet, "read as mm, travel at most 0.0001 m") is not None


def test_an_unknown_unit_is_refused(tmp_path):
    sheet = Sheet("quadrupteron")
    units = ["s", *["cm"] * 4, *["N"] * 4]
    rows = [sheet.names("t", "rho{}", "force{}"), [f"[{u}]" for u in units]]
    path = written(tmp_path, [*rows, *sheet.rows(seconds(sheet))])
    assert refused_then_read(path, sheet, "column rho1 is in 'cm', which is not known") is not None


def test_the_unit_of_a_drives_torque_must_be_said(tmp_path):
    sheet = Sheet("delta")
    names = sheet.names("t", "Axis{}.ActPos", "Axis{}.ActTorque")
    path = written(tmp_path, [names, *sheet.rows(seconds(sheet))])
    log = refused_then_read(path, sheet, "the unit of these torques is not said")
    assert log is not None
    assert log.description.force_unit == "%"


def test_columns_of_unknown_names_are_declared_as_the_message_shows(tmp_path):
    sheet = Sheet("quadrupteron")
    names = ['Uhr "1" \\', *(f"Weg {c}" for c in "abcd"), *(f"Kraft {c}" for c in "abcd")]
    path = written(tmp_path, [names, *sheet.rows(seconds(sheet))], ";")
    told = "no columns for the time; .* no columns for the sliders; .* no columns for the forces"
    assert refused_then_read(path, sheet, told) is not None
