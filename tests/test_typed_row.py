"""A row that was typed is written as a table of one row is."""

import math

import numpy as np
import polars as pl
import pytest

from pteron.cli.typed_row import TypedRow
from pteron.tables import Table

RNG = np.random.default_rng(7)
VALUES = [
    *(RNG.choice([-1.0, 1.0], 3000) * 10.0 ** RNG.uniform(-30.0, 30.0, 3000)).tolist(),
    *(RNG.choice([-1.0, 1.0], 2000) * 10.0 ** RNG.uniform(-7.0, -3.0, 2000)).tolist(),
    *(RNG.choice([-1.0, 1.0], 2000) * 10.0 ** RNG.uniform(14.0, 18.0, 2000)).tolist(),
    *(0.0, -0.0, 1.0, 1e-6, 1e-5, -1e-5, 9.999e-5, 1e-4, 1e15, 1e16, 1e22, 1e100, 5e-324),
]


def both(cells):
    table = Table("the command line", pl.DataFrame(cells))
    return TypedRow(cells), table


def test_numbers_have_the_text_that_tables_have():
    row, table = both({"x": VALUES, "y": VALUES[::-1]})
    assert "".join(row.text()) == "".join(table.text())
    assert row.json() == table.json()


def test_results_stand_behind_what_was_typed():
    for part in both({"x": [0.5], "rho1": [0.25], "y": [-2.0]}):
        found = part.with_columns({"rho1": np.array([1e-5]), "rho2": np.array([np.nan])})
        assert found.columns == ("x", "y", "rho1", "rho2")
        assert "".join(found.text()) == "x,y,rho1,rho2\n0.5,-2.0,0.00001,\n"
        assert found.json() == '[{"x":0.5,"y":-2.0,"rho1":0.00001,"rho2":null}]'
        assert [found.empty(name) for name in found.columns] == [0, 0, 0, 1]
        assert list(found.rows(["rho2", "x"], 3)) == [(None, 0.5)]
        np.testing.assert_array_equal(found.numbers(["y", "x"]), [[-2.0, 0.5]])
        assert found.place(0) == "the command line: row 1"
        assert (len(found), found.frame.height) == (1, 1)


@pytest.mark.parametrize("modes", [[1, 2], [None]])
def test_a_row_is_repeated_for_each_assembly_mode(modes):
    row, _ = both({"rho1": [0.5], "z": [9.0]})
    poses = [math.nan if mode is None else 0.25 * mode for mode in modes]
    found = row.repeat_modes(modes, ["z"]).with_columns({"z": poses})
    told = ["1,0.5,,"] if modes == [None] else ["1,0.5,1,0.25", "1,0.5,2,0.5"]
    assert "".join(found.text()).splitlines() == ["row,rho1,mode,z", *told]
    assert found.frame["mode"].null_count() == modes.count(None)
