"""The page of an identification: whole, needing nothing else, and true to the result."""

import json
import re
import tomllib
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from logs_of_motions import log_of
from mechanisms import CATALOG, CLIENTS, gated
from page_reader import HOSTILE, Reader, strict

import pteron
from pteron.identification import Terms, identification_model, identify
from pteron.plots import certainty_figure, comparison_figure, errors_figure, residual_speed_figure
from pteron.report.identification import (
    model_path,
    numbers,
    parameter_rows,
    value_with_uncertainty,
    write_identification,
)
from pteron.report.identification.contents import contents, short_sources, shorten_sources
from pteron.report.identification.page import page
from pteron.report.identification.values import html_expressions, html_names
from pteron.report.typeset import significant

NOISE = {"duration": 5.0, "rate": 400.0, "joint_noise": 2e-7, "force_noise": 0.05}


def one_sample(held):
    """Return a held-out recording of which there is nothing to draw."""
    kept = ("time", "measured", "predicted", "without_friction", "speed", "used")
    return replace(held, **{name: getattr(held, name)[:1] for name in kept})


@lru_cache
def result(name):
    """Return a result of each kind that a page has words for."""
    if name == "no bodies":
        found = result("quadrupteron")
        note = "No model of real bodies: Clarabel is missing; pip install pteron[consistency]"
        held = (one_sample(found.held_out[0]),)
        return replace(found, consistency=None, notes=(note,), held_out=held)
    if name == "unreal":
        found = result("hostile")
        assert found.consistency is not None
        violation = "u1: inertia too small by 0.0012 for -0.3 kg m"
        consistency = replace(
            found.consistency,
            feasible=False,
            distance=7.3,
            p_value=1e-4,
            at_border=("u1", "l1", "l2", "l3", "u2", "u3", "total mass <= 4"),
            cad_feasible=False,
            cad_violations=(violation,),
            nearest_to="nothing",
        )
        held = (one_sample(found.held_out[0]),)
        return replace(found, consistency=consistency, consistency_share=0.43, held_out=held)
    robot = CATALOG["quadrupteron" if name == "quadrupteron" else "delta"]
    shape = NOISE | {"duration": 12.0} if name == "quadrupteron" else NOISE
    fit = replace(log_of(robot, **shape, seed=3), source="/home/someone/logs/a.csv")
    if name == "quadrupteron":
        return identify(robot, fit)
    other = log_of(robot, **NOISE, seed=5, noise_seed=1, period=3.0)
    # A force that no term of the model makes.
    wrong = other.forces + 14.0 * np.sin(9.0 * other.time)[:, None]
    return identify(
        replace(robot, name=HOSTILE),
        [replace(fit, source=f"{HOSTILE}1.csv"), log_of(robot, **NOISE, seed=3, noise_seed=2)],
        held_out=[replace(other, source=s, forces=wrong) for s in ("x/1.csv", "y/1.csv")],
        terms=Terms(passive="each", rotors=True),
    )


NAMES = ["quadrupteron", "no bodies", "unreal", "hostile"]
EVERY = pytest.mark.parametrize("name", gated(NAMES, ["hostile"]))


@lru_cache
def html(name):
    return page(result(name), "model.toml")


@lru_cache
def read(name):
    return Reader(html(name))


@EVERY
def test_the_page_is_whole_and_needs_nothing_else(name):
    found = read(name)
    assert found.faults == []
    assert found.open == []
    assert found.sources == []
    assert not {"link", "img", "script", "image"} & set(found.counts)
    for word in ("http", "@import", "url(//", "src=", "/home/"):
        assert word not in html(name)
    assert len(set(found.ids)) == len(found.ids)
    for link in found.links:
        assert link.startswith("#")
        assert link[1:] in found.ids
    assert found.counts["h1"] == 1
    n = len(result(name).robot.legs)
    drawn = 1 + len([one for one in result(name).held_out if len(one.time) > 1])
    # Errors, forces and time of each recording; over speed; as noise, certainty; verdict's sign.
    assert found.counts["svg"] == drawn * (2 + n) + n + 4 + 1


@EVERY
def test_no_number_is_missing(name):
    text = read(name).text.replace(HOSTILE, "").replace(HOSTILE.split("/")[-1], "")
    for word in ("nan", "None", "Undefined", "inf", "{{", "{%"):
        assert not re.search(rf"(?<!\w){re.escape(word)}(?!\w)", text.replace("None:", "")), word
    assert not re.search(r"(?<!\de)(?<!\w)-\d", text), "a hyphen where a minus belongs"


@EVERY
def test_the_page_says_the_verdict_first(name):
    found, text = result(name), read(name).text
    grade = found.verdict.grade.capitalize()
    assert text.index(grade) < text.index("Worst held-out NRMS") < text.index("How well forces")
    if name == "hostile":
        assert grade == "Not trustworthy"
        assert 'class="verdict bad"' in html(name)
    shown = contents(found)
    for reason in shown.result.verdict.reasons:
        assert " ".join(reason.split()) in text
    assert shown.worst == pytest.approx(max(p.nrms.max() for p in found.held_out))
    assert shown.worst_floor <= max(p.floor.max() for p in found.held_out)
    repeats = name in ("quadrupteron", "no bodies")
    assert shown.repeats == repeats
    assert ("what was held out of it" in text) == repeats


@EVERY
def test_the_page_shows_the_numbers(name):
    found, text = result(name), read(name).text
    for prediction in (*found.held_out, *found.fitted):
        errors = prediction.nrms, prediction.nrms_without_friction, prediction.floor
        for value in np.concatenate(errors):
            assert f"{significant(float(value))} %" in text
    for row in parameter_rows(found):
        value, half = value_with_uncertainty(row.value, row.half)
        assert f"{value} {half} {row.unit.split()[0]}" in text
    consistency = found.consistency
    if consistency is None:
        assert "No model of real bodies" in text
    else:
        for leg in consistency.robot.legs:
            for inertia in leg.bodies.values():
                assert significant(inertia.mass, 4) in text
    assert ("CAD model itself is not real" in text) == (name == "unreal")
    if name == "unreal":
        assert "7.3 standard deviations away (p = 0.00010)" in text
        assert "by 0.0012 for \u22120.3" in text
        assert "by 43 % of what" in text
        assert html(name).count('<span class="chip weak">border</span>') == 6


def test_a_notebook_shows_the_values_too():
    for name in ("quadrupteron", "hostile"):
        found = result(name)
        shown = found._repr_html_()
        assert f"identified, {found.verdict.grade}" in shown
        for row in parameter_rows(found):
            assert f'{row.expression}</td><td class="number">' in shown
            assert f"{row.half:.2g}</td>".replace("-", "\u2212") in shown.replace("-", "\u2212")
        known = f"{len(found.estimate.values)} values, {found.verdict.grade}>"
        assert repr(found).endswith(f": {known}")


def test_values_are_judged_one_by_one():
    found = result("quadrupteron")
    rows = parameter_rows(found)
    estimate = found.estimate
    assert [row.name for row in rows] == list(estimate.names)
    low, high = estimate.intervals()
    for k, row in enumerate(rows):
        assert (row.value - row.half, row.value + row.half) == pytest.approx((low[k], high[k]))
        assert row.relative == pytest.approx(estimate.relative_deviations[k])
        assert (row.status == "unseen") == (row.name in found.unseen)
        assert row.weak == (row.name in (*found.unseen, *found.essential.dropped))
        assert (row.cad is None) == (k >= found.model.base.rank)
        others = np.delete(np.abs(estimate.correlation[k]), k)
        assert (row.partner is not None) == (others.max() > 0.95)
        if row.partner is not None:
            assert abs(row.correlation) == pytest.approx(others.max())
    assert any(row.status == "unseen" for row in rows)
    assert any(row.weak and row.status != "unseen" for row in rows)


def test_the_stretch_drawn_is_where_the_model_misses_most():
    found = contents(result("hostile")).held_out[0]
    p = found.prediction
    missed = (((p.measured - p.predicted) / p.size) ** 2 * p.used).sum(axis=1)
    length = found.stretch.stop - found.stretch.start
    every = [missed[k : k + length].sum() for k in range(len(missed) - length)]
    assert length < len(missed)
    assert missed[found.stretch].sum() >= (1.0 - 1e-9) * max(every)


@CLIENTS
def test_a_recording_of_one_sample_is_not_drawn():
    assert contents(result("no bodies")).drawn == ()
    assert "Over the joint's speed: a.csv, fitted" in read("no bodies").text


def test_autocorrelations_are_those_of_the_estimate():
    found = contents(result("quadrupteron"))
    first = found.result.estimate.whiteness.autocorrelation
    np.testing.assert_allclose(found.correlations[0], first, atol=1e-9)


@EVERY
def test_numbers_are_json(name):
    data = strict(json.dumps(numbers(result(name)), allow_nan=False))
    assert data["verdict"]["grade"] == result(name).verdict.grade
    values = result(name).estimate.values
    np.testing.assert_array_equal(data["estimate"]["values"], values)
    assert (data["real_bodies"] is None) == (result(name).consistency is None)


def test_numbers_that_are_not_finite_are_null():
    found = result("quadrupteron")
    zero = replace(found.estimate, values=np.zeros_like(found.estimate.values))
    data = numbers(replace(found, estimate=zero, consistency_share=float("nan")))
    assert set(data["estimate"]["relative_deviations"]) == {None}
    assert data["real_bodies"]["share_of_residual"] is None


@EVERY
def test_the_files_are_written_whole(name, tmp_path, monkeypatch):
    module = "pteron.report.identification.page"
    monkeypatch.setattr(
        f"{module}.page", lambda found, file: html(name).replace("model.toml", file or "")
    )
    found = write_identification(result(name), tmp_path / "a" / "b")
    folder = tmp_path / "a" / "b"
    assert found.page == folder / "identification.html"
    assert sorted(folder.iterdir()) == sorted(found.paths)
    assert found.page.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    consistency = result(name).consistency
    assert (found.model is None) == (consistency is None)
    if found.model is None or consistency is None:
        return
    assert f"bodies in {found.model.name}." in found.page.read_text(encoding="utf-8")
    text = found.model.read_text(encoding="utf-8")
    assert tomllib.loads(text)["name"] == result(name).robot.name
    assert text.startswith("# ")
    assert f"# Verdict: {result(name).verdict.grade}." in text
    robot = pteron.load(found.model)
    assert robot == result(name).machine
    np.testing.assert_array_equal(pteron.parameters(robot), consistency.parameters)


def test_a_model_file_replaces_nothing_that_was_read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert model_path("out", "a/b c").name == "a_b_c.toml"
    assert model_path("out", "..").name == "robot.toml"
    assert model_path(".", "delta", ["log.csv", "out/delta.toml"]) == Path("delta.toml")
    with pytest.raises(pteron.OutputError, match="would replace a file that is read"):
        model_path(tmp_path, "delta", ["log.csv", "delta.toml"])
    with pytest.raises(pteron.OutputError, match=r"the description of delta\.csv"):
        model_path(tmp_path, "delta", ["delta.csv"])


def test_names_as_people_read_them():
    terms = Terms(passive="each", rotors=True, payload=True)
    model = identification_model(CATALOG["quadrupteron"], terms)
    found = html_names(model)
    assert found["mgx_u2"] == "<i>m\u03b3</i><sub>x,u2</sub>"
    assert found["Fc1"] == "<i>F</i><sub>c1</sub>"
    assert found["Fv_R1_2"] == "<i>F</i><sub>v,R1,2</sub>"
    assert found["Fv_R4"] == "<i>F</i><sub>v,R4</sub>"
    assert found["offset3"] == "offset<sub>3</sub>"
    assert found["mgx_L"] == "<i>m\u03b3</i><sub>x,L</sub>"
    first = html_expressions(model)[0]
    assert first.startswith("<i>m</i><sub>p1</sub> + <i>m</i><sub>u1</sub> + 20.11\u202f<i>I</i>")
    assert "<i>J</i><sub>m2</sub>" in html_expressions(model)[1], "a rotor joins its slider"
    names = short_sources(result("hostile"))
    assert shorten_sources(["x/1.csv: row 7, log.csv"], names) == ("x/1.csv: row 7, log.csv",)
    assert short_sources(result("quadrupteron")) == {"/home/someone/logs/a.csv": "a.csv"}
    assert value_with_uncertainty(1234.5, 678.9) == ("1234", "679")
    assert value_with_uncertainty(2.5, 0.0) == ("2.50000", "0")
    assert value_with_uncertainty(2.0, 0.0996) == ("2.00", "0.10")


def test_pictures_show_what_they_are_given():
    time = np.linspace(0.0, 1.0, 400)
    measured_force, predicted = np.sin(9.0 * time), np.sin(9.0 * time) + 0.01
    used = time > 0.1
    figure = comparison_figure(time, measured_force, predicted, predicted, used, leg=1)
    force, rest = figure.axes
    np.testing.assert_array_equal(force.lines[0].get_ydata(), measured_force)
    np.testing.assert_array_equal(force.lines[2].get_ydata(), predicted)
    np.testing.assert_allclose(rest.lines[2].get_ydata()[used], -0.01)
    assert np.isnan(rest.lines[2].get_ydata()[~used]).all()
    assert len(force.patches) == 1
    speed = np.linspace(-1.0, 1.0, 400)
    axes = residual_speed_figure(speed, 2.0 * np.sign(speed), np.abs(speed) > 0.1, leg=0).axes[0]
    mean = axes.lines[-1].get_ydata()
    np.testing.assert_allclose(np.abs(mean[np.isfinite(mean)]), 2.0)
    axes = errors_figure(np.array([2.0, 3.0]), np.array([30.0, 3.0]), np.array([1.0, 0.0])).axes[0]
    low, high = axes.get_xlim()
    assert low < 1.0
    assert high > 30.0
    same = errors_figure(np.array([1.95, 2.3]), np.array([1.98, 2.31]), np.array([2.1, 2.2]))
    low, high = same.axes[0].get_xlim()
    assert sum(low < tick < high for tick in same.axes[0].get_xticks()) > 1, "one tells no scale"
    ratios = np.array([5.0, np.inf, 0.0])
    axes = certainty_figure(["a", "b", "c"], ratios, ratios < 2.0, 2).axes[0]
    assert [text.get_text() for text in axes.get_yticklabels()] == ["c", "b", "a"]


def test_marks_at_the_right_edge_of_a_picture_are_whole():
    """Without noise errors span many decades, and a value known exactly is at the end."""
    errors = errors_figure(np.array([1e-1, 1e-2]), np.array([30.0, 20.0]), np.array([1e-11, 1e-11]))
    ratios = np.array([5.0, np.inf, 1e9])
    certainty = certainty_figure(["a", "b", "c"], ratios, ratios < 2.0, 2)
    for figure in (errors, certainty):
        figure.canvas.draw()
        axes = figure.axes[0]
        page, inside = figure.bbox.extents, axes.bbox.extents
        marks = [line for line in axes.lines if line.get_marker() in ("o", "s")]
        assert marks
        for mark in marks:
            ends = mark.get_window_extent().extents
            assert (ends[2] <= inside[2]) or not mark.get_clip_on()
            assert ends[2] <= page[2]
