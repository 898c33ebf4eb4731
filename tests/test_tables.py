"""Tables in CSV and Parquet files: what is read, what is refused and in which words."""

from __future__ import annotations

import json
import os
import sys
from io import BytesIO, TextIOWrapper
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from pteron.errors import DataError, OutputError
from pteron.tables import CsvFile, Table, check_output, convert_to_si, read_table, write_table


@pytest.fixture
def given(tmp_path: Path):
    """Write a file and read it as a table."""

    def read(content: bytes, name: str = "poses.csv") -> Table:
        file = tmp_path / name
        file.write_bytes(content)
        return read_table(file)

    return read


@pytest.mark.parametrize(
    "content",
    [
        b"x,y\n1,2\n3,4\n",
        b"x,y\n1,2\n3,4",
        b"x,y\r\n1,2\r\n3,4\r\n",
        b"x,y\r1,2\r3,4\r",
        b"\xef\xbb\xbfx,y\n1,2\n3,4\n",
        b"x, y\n 1, 2\n 3, 4\n",
        b"\nx,y\n\n1,2\n  \n3,4\n\n\n",
        b'"x","y"\n"1","2"\n+3.0,4e0\n',
    ],
    ids=["plain", "no end", "crlf", "cr", "mark", "blanks", "blank lines", "quotes"],
)
def test_a_csv_file_is_read_however_it_was_written(given, content: bytes):
    table = given(content)
    np.testing.assert_array_equal(table.numbers(["x", "y"]), [[1, 2], [3, 4]])
    assert table.columns == ("x", "y")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty; its first line must name the columns"),
        (b" \n\n", "is empty"),
        (b"x,y\n", "has no rows below its header; the names are x, y"),
        (b"x,y\n1,2\n1,2,3\n", "row 2 (line 3) has 3 cells, but the header names 2 columns (x, y)"),
        (b"x,y,t\n1,2,9\n\n1,2\n", "row 2 (line 4) has 2 cells"),
        (b'x,y,t\n1,2,"a\nb"\n1,2\n', "row 2 (line 4) has 2 cells"),
        (b'x,y\n1,"2\n3,4\n', "check its quotes"),
        (b"x,y\n1,\xff\n", "not UTF-8 text"),
        ("x,y\n1,2\n".encode("utf-16"), "not UTF-8 text"),
        (b"x,y,x\n1,2,3\n", "two columns are called 'x'"),
        (b"0,-.5,0\n1,2,3\n", "its first line has numbers; it must name the columns"),
        (b"x,\ry\n1,2\n", "row 1 (line 2) has 1 cells"),
        (b'x,"y\n1,2\n', "its header is not CSV (unexpected end of data); check its quotes"),
        (b"x;y\n1,5;2\n", "its cells look separated by semicolons, with decimal commas; separate"),
    ],
)
def test_a_csv_file_that_is_none_is_refused(given, content: bytes, words: str):
    with pytest.raises(DataError) as caught:
        given(content)
    message = str(caught.value)
    assert "poses.csv: " in message
    assert words in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"x,y\n1,2\n3,\n", "row 2 (line 3), column y: the cell is empty"),
        (b"x,y\n1,2\n\n nan,4\n", "row 2 (line 4), column x: 'nan' given, a finite number"),
        (b"x,y\n1,1e999\n", "row 1 (line 2), column y: '1e999' given, a finite number"),
        (b"x,y\n1,2\n3,abc\nq,4\n", "row 2 (line 3), column y: 'abc' given, a number"),
        (b'x,y\n"1,5",2\n', "row 1 (line 2), column x: '1,5' given, a number"),
    ],
)
def test_a_cell_that_is_no_number_is_named(given, content: bytes, words: str):
    with pytest.raises(DataError, match="correct the cell") as caught:
        given(content).numbers(["x", "y"])
    assert words in str(caught.value)


def test_what_is_missing_may_become_nan_but_text_may_not(given):
    table = given(b"x,y\n1,\nnan,2\ninf,3\n")
    values = table.numbers(["x", "y"], on_failure="nan")
    np.testing.assert_array_equal(values, [[1, np.nan], [np.nan, 2], [np.nan, 3]])
    with pytest.raises(DataError, match="'abc' given, a number expected"):
        given(b"x,y\n1,abc\n").numbers(["x", "y"], on_failure="nan")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"x,y,z\n1,2,3\n", "no column phi (found: x, y, z; needed: x, y, phi)"),
        (b"1,2\n3,4\n", "the first line must name the columns"),
        (b"x;y;phi\n1;2;3\n", "its cells look separated by semicolons; separate the cells with"),
        (b"x\ty\n1\t2\n", "its cells look separated by tabs; separate the cells with commas"),
    ],
)
def test_a_missing_column_is_named_with_those_found(given, content: bytes, words: str):
    with pytest.raises(DataError) as caught:
        given(content).numbers(["x", "y", "phi"])
    assert words in str(caught.value)


def test_columns_that_are_not_needed_come_back_as_they_were(given, tmp_path: Path):
    table = given(b'id,x,note\n007,1.50,"a,b"\n008,-0,\n')
    result = table.with_columns({"rho1": [0.25, np.nan]})
    write_table(result.frame, tmp_path / "out.csv")
    assert (tmp_path / "out.csv").read_text() == ('id,x,note,rho1\n007,1.50,"a,b",0.25\n008,-0,,\n')


def test_a_result_replaces_the_column_of_its_name(given):
    table = given(b"rho1,x\n5,1\n").with_columns({"rho1": [0.5]})
    assert table.columns == ("x", "rho1")
    assert table.numbers(["rho1"]).tolist() == [[0.5]]


def test_json_has_numbers_and_null(given):
    table = given(b"x,t,note\n1.5,2,a\nnan,3,\n").with_columns({"rho1": [np.nan, 0.1]})
    assert json.loads(table.json()) == [
        {"x": 1.5, "t": 2, "note": "a", "rho1": None},
        {"x": None, "t": 3, "note": None, "rho1": 0.1},
    ]


def test_numbers_survive_both_kinds_of_file_to_the_last_digit(tmp_path: Path):
    values = np.random.default_rng(0).normal(size=(100, 2)) * 10.0 ** np.arange(-50, 50)[:, None]
    frame = pl.DataFrame({"x": values[:, 0], "y": values[:, 1]})
    for ending in (".csv", ".parquet"):
        file = write_table(frame, tmp_path / f"poses{ending}")
        np.testing.assert_array_equal(read_table(file).numbers(["x", "y"]), values)


def test_text_of_a_csv_file_is_numbers_in_parquet(given, tmp_path: Path):
    write_table(given(b"x,t,note\n1.5,2,a\n,3,b\n").frame, tmp_path / "out.parquet")
    frame = pl.read_parquet(tmp_path / "out.parquet")
    assert frame.schema == {"x": pl.Float64, "t": pl.Int64, "note": pl.String}


def test_parquet_holds_what_it_likes(tmp_path: Path):
    file = tmp_path / "poses.parquet"
    frame = pl.DataFrame({"x": [1, None], "y": ["2", "3"], "flag": [True, False]})
    frame.write_parquet(file)
    table = read_table(file)
    values = table.numbers(["x", "y"], on_failure="nan")
    np.testing.assert_array_equal(values, [[1, 2], [np.nan, 3]])
    with pytest.raises(DataError, match=r"row 2, column x: the cell is empty"):
        table.numbers(["x", "y"])
    with pytest.raises(DataError, match=r"column flag holds Boolean"):
        table.numbers(["flag"])
    for value in (np.inf, np.nan, "far"):
        pl.DataFrame({"x": [value]}).write_parquet(file)
        with pytest.raises(DataError, match=f"row 1, column x: '{value}' given"):
            read_table(file).numbers(["x"])
    with pytest.raises(DataError, match=r"no column z .*add what is missing"):
        table.numbers(["z"])


def test_a_parquet_file_that_is_none_is_refused(given, tmp_path: Path):
    with pytest.raises(DataError, match="not a Parquet file"):
        given(b"x,y\n1,2\n", "poses.parquet")
    pl.DataFrame({"x": []}).write_parquet(tmp_path / "empty.parquet")
    with pytest.raises(DataError, match="has no rows"):
        read_table(tmp_path / "empty.parquet")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("nowhere.csv", "no such file"),
        ("folder", "is a folder"),
        ("folder.csv", "is a folder"),
        ("poses.xlsx", "unknown ending '.xlsx'; a table's file ends in .csv or .parquet"),
        ("poses", "no ending"),
        ("poses.xlsx/poses.csv", "cannot be read"),
    ],
)
def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path, name: str, words: str):
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder.csv").mkdir()
    for file in ("poses.xlsx", "poses"):
        (tmp_path / file).write_text("x,y\n1,2\n")
    with pytest.raises(DataError) as caught:
        read_table(tmp_path / name)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("folder.csv", "is a folder"),
        ("out.txt", "unknown ending '.txt'"),
        ("nowhere/out.csv", "there is no folder"),
    ],
)
def test_a_file_that_cannot_be_written_is_refused_early(tmp_path: Path, name: str, words: str):
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(OutputError) as caught:
        check_output(tmp_path / name)
    assert words in str(caught.value)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["folder.csv"]


def test_units_in_names_are_converted(given):
    units = {"t": "s", "x": "m", "dx": "m/s", "roll": "rad", "fx": "N"}
    table = given(
        b"t (ms),x[mm],dx (mm/s),roll (deg),fx [N],note (mm)\n500,2,3,180,4,a\n,1,1,1,1,b\n"
    )
    table = convert_to_si(table, units)
    assert table.columns == ("t", "x", "dx", "roll", "fx", "note (mm)")
    found = table.numbers(list(units), "nan")
    np.testing.assert_allclose(found[0], [0.5, 0.002, 0.003, np.pi, 4.0], rtol=1e-15)
    with pytest.raises(DataError, match=r"column t: the cell is empty"):
        table.numbers(["t"])
    for content, words in (
        (b"x (deg)\n1\n", r"column x \(deg\): the unit of x is one of m, mm, um"),
        (b"dx (mm)\n1\n", r"the unit of dx is one of m/s, mm/s"),
        (b"x,x (mm)\n1,2\n", r"x and x \(mm\) given; keep one of them"),
    ):
        with pytest.raises(DataError, match=words):
            convert_to_si(given(content), units)


def test_a_table_that_a_file_cannot_hold_leaves_the_old_file(tmp_path: Path):
    file = tmp_path / "out.csv"
    file.write_text("old")
    with pytest.raises(OutputError, match="cannot hold this table"):
        write_table(pl.DataFrame({"x": [[1, 2]]}), file)
    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


def test_standard_input_is_csv(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sys, "stdin", TextIOWrapper(BytesIO(b"x,y\n1,2\n")))
    table = read_table("-")
    assert table.source == "standard input"
    assert table.numbers(["y"]).tolist() == [[2.0]]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="FIFOs of POSIX")
def test_a_fifo_and_a_device_are_refused_before_they_are_opened(tmp_path: Path):
    """A FIFO without a writer waits for ever, and /dev/zero never ends."""
    fifo = tmp_path / "poses.csv"
    os.mkfifo(fifo)
    for path in (fifo, "/dev/zero"):
        with pytest.raises(DataError, match="it is a pipe or a device, not a file; pipe its text"):
            read_table(path)


@pytest.mark.skipif(not Path("/dev/fd").exists(), reason="open files by name")
def test_a_pipe_that_a_shell_has_opened_is_csv():
    out, into = os.pipe()
    os.write(into, b"x,y\n1,2\n")
    os.close(into)
    assert read_table(f"/dev/fd/{out}").numbers(["y"]).tolist() == [[2.0]]
    os.close(out)


NOTES = b"n,note,x\n" + b"".join(
    b'%d,"a ""note""\nof, %d lines",%d\n\n' % (i, i % 7, i) if i % 3 else b"%d,plain,%d\n" % (i, i)
    for i in range(200)
)


@pytest.mark.parametrize("block", [50, 64, 997, 1 << 20])
@pytest.mark.parametrize("columns", [None, ["x"]], ids=["all", "one"])
def test_a_file_is_read_alike_in_blocks_of_any_size(block: int, columns: list[str] | None):
    tables = list(CsvFile(NOTES, "notes", block=block).tables(columns))
    assert len(tables) == 1 if block > len(NOTES) else len(tables) > 5
    values = np.concatenate([table.numbers(["x"])[:, 0] for table in tables])
    np.testing.assert_array_equal(values, np.arange(200))
    assert [table.first_row for table in tables] == np.cumsum([0, *map(len, tables)])[:-1].tolist()
    last = tables[-1]
    assert last.place(len(last) - 1) == f"notes: row 200 (line {2 + 67 + 3 * 132})"


@pytest.mark.parametrize("block", [30, 1 << 20])
def test_a_fault_behind_many_blocks_is_placed(block: int):
    rows = b"".join(b"%d,%d\n" % (i, i) for i in range(100))
    file = CsvFile(b"x,y\n" + rows.replace(b"90,90", b"90"), "file", block=block)
    with pytest.raises(DataError, match=r"row 91 \(line 92\) has 1 cells"):
        list(file.tables())
    file = CsvFile(b"x,y\n" + rows.replace(b"90,90", b"90,oops"), "file", block=block)
    with pytest.raises(DataError, match=r"row 91 \(line 92\), column y: 'oops' given"):
        [table.numbers(["y"]) for table in file.tables(["y"])]


def test_a_quote_that_is_never_closed_is_told_without_reading_on():
    content = b"x,y\n" + b'1,"2\n' + b"3,4\n" * 1_000_000
    with pytest.raises(DataError, match=r"behind row 0 is not CSV .*check its quotes"):
        list(CsvFile(content, "file", block=10_000).tables())


def test_a_cell_of_a_million_digits_takes_no_longer_than_its_length(given):
    with pytest.raises(DataError, match=r"row 1 .* column x: '111"):
        given(b"x,y\n" + b"1" * 1_000_000 + b"x,2\n").numbers(["x", "y"])


def test_the_last_row_of_a_long_table_is_found(given):
    content = b"x,y\n" + b"1,2\n" * 20_000 + b"1,\n"
    with pytest.raises(DataError, match=r"row 20001 \(line 20002\), column y"):
        given(content).numbers(["x", "y"])
