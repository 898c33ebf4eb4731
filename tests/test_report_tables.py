"""The report's tables: equal legs once, components of vectors, strokes, and what is left out."""

import re
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from page_reader import Reader

import pteron
from pteron.report.contents import contents
from pteron.report.equal_rows import by_component, merge_legs, merge_sums, strokes
from pteron.report.page import geometry, page
from pteron.workspace import joint_ranges


@lru_cache
def report(name):
    return contents(pteron.load(name))


@lru_cache
def read(name):
    return Reader(page(report(name)))


def index(letter, leg):
    return f"<i>I</i><sub>{letter}{leg}</sub>"


def test_base_parameters_that_differ_by_the_leg_are_one_row():
    lines = [f"{index('u', i)} + 0.5 {index('l', i)}" for i in (1, 2, 3)]
    other = f"{index('u', 1)} + {index('u', 2)}"
    merged = merge_sums([*lines, other], ["2", "2", "2", "2"], ["kg m^2"] * 4)
    assert [row.numbers for row in merged] == [(1, 2, 3), (4,)]
    assert merged[0].expression == (
        f"{index('u', '<i>i</i>')} + 0.5 {index('l', '<i>i</i>')}, <i>i</i> = 1 to 3"
    )
    assert merged[1].expression == other


def test_base_parameters_with_other_values_stay_apart():
    lines = [index("u", i) for i in (1, 2)]
    merged = merge_sums(lines, ["2", "3"], ["kg m^2"] * 2)
    assert [(row.numbers, row.expression) for row in merged] == [((1,), lines[0]), ((2,), lines[1])]


def test_every_base_parameter_is_in_one_row():
    base = report("3-rpr").base
    lines = list(map(str, base.expressions("html")))
    merged = merge_sums(lines, ["1"] * base.rank, [""] * base.rank)
    assert sorted(k for row in merged for k in row.numbers) == list(range(1, base.rank + 1))
    assert len(merged) < base.rank


def test_equal_rows_have_the_numbers_of_their_legs():
    assert merge_legs([("a", 0), ("b", 1), ("a", 2), ("c", None)]) == {
        "a": [1, 3],
        "b": [2],
        "c": [],
    }


def test_vectors_that_differ_have_a_row_for_each_component():
    rows = by_component(geometry(pteron.load("delta")))
    names = [name for name, _ in rows]
    assert {"guide point x", "guide point y", "guide point z", "upper length"} <= set(names)
    assert all(len(texts) == 3 for _, texts in rows)
    assert not any("(" in text for _, texts in rows for text in texts)
    alike = dict(by_component([("direction", ["(0, 0, 1)", "(0, 0, 1)"])]))
    assert alike == {"direction": ["(0, 0, 1)", "(0, 0, 1)"]}


def test_a_stroke_stands_between_the_limits():
    found = report("3-rpr")
    for i, stroke in enumerate(strokes(found)):
        low, high = found.robot.legs[i].limits
        span = joint_ranges(found.robot, found.cycle.pose)
        start, width = (float(text.rstrip("%")) for text in stroke.motion)
        assert start == pytest.approx(100.0 * (span.least[i] - low) / (high - low), abs=0.06)
        assert start + width == pytest.approx(
            100.0 * (span.greatest[i] - low) / (high - low), abs=0.11
        )
        first, wide = (float(text.rstrip("%")) for text in stroke.workspace)
        home = float(stroke.home.rstrip("%"))
        assert 0.0 <= first <= home <= first + wide <= 100.1


def test_rams_have_strokes_in_place_of_a_constant_measure():
    text = read("3-rpr").text
    assert "between its limits" in text
    assert "type-I measure" not in text.partition("Workspace")[0]
    assert "The type-I measure is 1 everywhere, so that it has no map." in text
    assert "No leg has a type-I singularity: a ram pushes the platform point" in text


def test_the_legend_names_what_the_slices_show():
    found = report("3-rpr")
    shown = {int(k) for cut in found.slices for k in np.unique(cut.status) if k > 0}
    assert {i + 1 for i in found.missing_legs} >= shown
    legend = re.findall(r"out of reach of leg (\d)", read("3-rpr").text)
    assert [int(leg) for leg in legend] == [i + 1 for i in found.missing_legs]


def test_every_printed_sheet_has_the_machines_name():
    named = replace(report("3-rpr"), robot=replace(report("3-rpr").robot, name='a"}</style>'))
    text = page(named)
    assert r'@bottom-left { content: "a\22 \7d \3c \2f style\3e "' in text
    assert text.count("</style>") == Reader(text).counts["style"]
    assert "counter(page)" in text
