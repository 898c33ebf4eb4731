"""Base parameters: counts of the literature, three methods that agree, certificates, symbols."""

import json
import re
import shutil
import subprocess
from dataclasses import replace
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
import sympy
import tilting
from mechanisms import (
    CLIENTS,
    MACHINES,
    MECHANISMS,
    NIGHTLY,
    TILTED,
    gated,
    in_turn,
    random_machine,
    relative_error,
    several,
    states,
)
from scipy.spatial.transform import Rotation

import pteron
from pteron.errors import ModelError
from pteron.reduction import ExactCertificate, NumericalCertificate, base_regressor
from pteron.reduction.exact_geometry import exact_geometry
from pteron.reduction.symbols import algebraic_values

METHODS = ("exact", "svd", "qr")
GENERIC = (1.2, -2.3, -9.4)
NONE = (0.0, 0.0, 0.0)


def machine(name, gravity=None, lengths=None):
    robot = pteron.load(name)
    if gravity is not None:
        robot = replace(robot, gravity=gravity)
    if lengths is not None:
        legs = tuple(
            replace(leg, upper_length=lengths[0], lower_length=lengths[1]) for leg in robot.legs
        )
        robot = replace(robot, legs=legs)
    return robot


def threefold(offset=0.04):
    """A Quadrupteron with three legs at 120 degrees about k: its directions hold sqrt(3)."""
    robot = pteron.load("quadrupteron")
    legs = [robot.legs[0]]
    for i in range(3):
        turn = Rotation.from_rotvec([0.0, 0.0, 2 * np.pi * i / 3]).as_matrix()
        model = robot.legs[2]
        legs.append(
            replace(
                model,
                guide_point=turn @ model.guide_point,
                direction=turn @ model.direction,
                platform_point=turn @ [0.0, offset, 0.0],
            )
        )
    return replace(robot, name="threefold", legs=tuple(legs))


def on_a_wall(name):
    return pteron.turned(pteron.load(name), Rotation.random(rng=4).as_matrix(), gravity=False)


def sliding(name):
    """Return a machine whose platform points slide by phi, where they turned."""
    robot = pteron.load(name)
    return replace(robot, platform=replace(robot.platform, slides=True))


def upright(motion, *kinds):
    """Return a machine that tilts, drawn at random, with gravity along -z of its platform."""
    robot = tilting.machine(motion, kinds, 3)[0]
    platform = robot.platform
    up = np.array(platform.axis)
    if motion == "2R":
        up = np.cross(up, platform.second_axis)
    return replace(robot, gravity=tuple(-9.81 * up / np.linalg.norm(up)))


def symmetric(motion):
    """Return a hexapod or a tripod of threefold symmetry, upright, with plain dimensions."""
    model = tilting.machine(motion, ("UPS",) if motion == "3T3R" else ("RRS",), 3)[0]
    azimuths = (10, 110, 130, 230, 250, 350) if motion == "3T3R" else (0, 120, 240)
    legs = []
    for i, (leg, base) in enumerate(zip(model.legs, azimuths, strict=True)):
        top = (50, 70, 170, 190, 290, 310)[i] if motion == "3T3R" else base
        given = {"guide_point": around(0.4, base), "platform_point": around(0.25, top)}
        if motion == "1T2R":
            given |= {"direction": around(1.0, base + 90), "zero_direction": around(1.0, base)}
            given |= {"upper_length": 0.2, "lower_length": 0.3, "elbow": 1}
        legs.append(replace(leg, **given))
    platform = replace(model.platform, axis=(0.0, 0.0, 1.0), x_axis=(1.0, 0.0, 0.0), planes=())
    return pteron.Manipulator(f"symmetric {motion}", platform, tuple(legs))


def around(radius, degrees):
    angle = np.radians(degrees)
    return radius * np.cos(angle), radius * np.sin(angle), 0.0


COUNTS = {
    "quadrupteron, gravity along leg 1": (machine("quadrupteron"), False, 26),
    "quadrupteron, generic gravity": (machine("quadrupteron", GENERIC), False, 28),
    "quadrupteron-oblique": (machine("quadrupteron-oblique"), False, 28),
    "tripteron-oblique": (machine("tripteron-oblique"), False, 19),
    "tripteron, generic gravity": (machine("tripteron", GENERIC), False, 18),
    "tripteron, gravity along a leg": (machine("tripteron"), False, 16),
    "tripteron, no gravity": (machine("tripteron", NONE), False, 12),
    "delta": (machine("delta"), False, 13),
    "delta, gravity along a crank's axis": (machine("delta", (0.0, 9.81, 0.0)), False, 11),
    "delta, no gravity": (machine("delta", NONE), False, 7),
    "a slider and two cranks": (MECHANISMS["random PRR 0"], False, 15),
    "two sliders and a crank": (MECHANISMS["random RPP 0"], False, 17),
    "quadrupteron, shared": (machine("quadrupteron", GENERIC), True, 11),
    "quadrupteron, shared, equal lengths": (
        machine("quadrupteron", GENERIC, (0.18, 0.18)),
        True,
        10,
    ),
    "tripteron-oblique, shared": (machine("tripteron-oblique", None, (0.2, 0.21)), True, 7),
    "tripteron, shared": (machine("tripteron", GENERIC), True, 6),
    "tripteron, shared, no gravity": (machine("tripteron", NONE), True, 4),
    "delta, shared": (machine("delta"), True, 5),
    "delta-4": (machine("delta-4"), False, 19),
    "delta-4, no gravity": (machine("delta-4", NONE), False, 12),
    "delta-4, its cranks shared": (machine("delta-4"), [(1, 2, 3)], 11),
    "delta-omnid": (machine("delta-omnid"), False, 13),
    "linear-delta": (machine("linear-delta"), False, 7),
    "linear-delta, generic gravity": (machine("linear-delta", GENERIC), False, 7),
    "linear-delta, shared": (machine("linear-delta"), True, 3),
    "orthoglide": (machine("orthoglide"), False, 7),
    "tripteron-colinear": (machine("tripteron-colinear"), False, 19),
    "tripteron-router": (machine("tripteron-router"), False, 16),
    "par4": (machine("par4"), False, 20),
    "par4, gravity along two cranks' axes": (machine("par4", (9.81, 0.0, 0.0)), False, 16),
    "par4, shared": (machine("par4"), True, 8),
    "h4": (machine("h4"), False, 20),
    "h4, its nacelle sliding": (sliding("h4"), False, 20),
    "five-bar": (machine("five-bar"), False, 7),
    "five-bar, gravity in the plane": (machine("five-bar", (0.0, -9.81, 0.0)), False, 11),
    "five-bar, on a wall": (on_a_wall("five-bar"), False, 11),
    "five-bar, shared": (machine("five-bar"), True, 4),
    "3-rrr, gravity in the plane": (machine("3-rrr", (0.0, -9.81, 0.0)), False, 19),
    "3-rrr, gravity along the axes": (machine("3-rrr", (0.0, 0.0, -9.81)), False, 13),
    "3-rrr, shared": (machine("3-rrr", (0.0, -9.81, 0.0)), True, 9),
    "3-prr": (machine("3-prr"), False, 13),
    "3-prr, on a wall": (on_a_wall("3-prr"), False, 13),
    "any P-R-R-R, R-S-S and P-S-S": (random_machine(0, "PRS"), False, 13),
    "the same with a shaft": (random_machine(0, "PRSU"), False, 19),
    "sliders and rods": (random_machine(0, "PPSS"), False, 20),
    "any R-R-R and P-R-R": (random_machine(0, "CL"), False, 9),
    "the same, three legs": (random_machine(0, "CCL"), False, 17),
    "any planar cranks and a shaft": (random_machine(0, "CCU"), False, 17),
    "a planar leg and two in space": (random_machine(0, "CPR"), False, 19),
    "6-UPS": (upright("3T3R", "UPS"), False, 28),
    "6-UPS, symmetric": (symmetric("3T3R"), False, 28),
    "6-PSS": (upright("3T3R", "PSS"), False, 22),
    "6-RSS": (upright("3T3R", "RSS"), False, 34),
    "3-UPS and 3-PSS": (upright("3T3R", "UPS", "PSS"), False, 25),
    "3-RRS": (upright("1T2R", "RRS"), False, 25),
    "3-RRS, symmetric": (symmetric("1T2R"), False, 25),
    "3-RPS": (upright("1T2R", "RPS"), False, 25),
    "3-PRS": (upright("1T2R", "PRS"), False, 19),
    "wrist": (upright("3R", "UPS"), False, 18),
    "ankle": (upright("2R", "RSS"), False, 17),
}
"""A machine, which legs share their parameters, and how many base parameters there are."""

UNEXPLAINED = {case for case in COUNTS if case.startswith(("tripteron,", "tripteron-router"))}
"""Sliders at right angles, which no mass transfer tells of."""

FAMILY = (
    *("delta-4", "linear-delta", "orthoglide", "par4", "h4, its nacelle sliding", "five-bar"),
    *("3-rrr, gravity in the plane", "3-prr", "the same with a shaft", "the same, three legs"),
)
"""Every kind of leg and of platform."""

PLAIN = ("quadrupteron, gravity along leg 1", "tripteron-oblique", "delta")

COUNTED = (
    *("quadrupteron, generic gravity", "tripteron, gravity along a leg", "tripteron, no gravity"),
    *("delta, gravity along a crank's axis", "delta-4", "h4, its nacelle sliding"),
    *("five-bar, gravity in the plane", "3-prr", "quadrupteron, shared, equal lengths"),
    *("3-RRS, symmetric", "wrist", "ankle"),
)
"""Every closure, platform and leg; parameters shared or not; gravity along an axis, askew, none."""

TILTING = ("6-UPS", "6-RSS", "3-RRS, symmetric", "3-PRS", "wrist")
"""Platforms that tilt, whose parameters do not turn with the machine."""

FEW = ("tripteron-oblique", "delta", "a slider and two cranks", "delta-4", "five-bar", "3-prr")


EVERY = in_turn([*MACHINES, *FAMILY], share=4)


@cache
def found(case, method="exact"):
    robot, shared, _ = COUNTS.get(case) or (MACHINES[case], False, None)
    return pteron.base_parameters(robot, method, shared=shared)


@pytest.mark.parametrize("case", gated(COUNTS, COUNTED))
def test_counts_of_the_literature_by_three_methods_that_agree(case):
    _, _, count = COUNTS[case]
    exact, svd, qr = (found(case, method) for method in METHODS)
    assert (exact.rank, svd.rank, qr.rank) == (count, count, count)
    assert exact.names == svd.names == qr.names
    scale = np.abs(exact.grouping).max()
    np.testing.assert_allclose(svd.grouping, exact.grouping, atol=1e-10 * scale)
    np.testing.assert_allclose(qr.grouping, exact.grouping, atol=1e-10 * scale)
    for numerical in (svd, qr):
        assert isinstance(numerical.certificate, NumericalCertificate)
        assert numerical.certificate.gap > 1e8
        assert numerical.certificate.residual < 1e-11
    assert "WHAT WAS DROPPED" not in svd.certificate.summary()
    certificate = exact.certificate
    assert isinstance(certificate, ExactCertificate)
    assert certificate.rank + certificate.null_vectors == certificate.columns
    assert certificate.transfers + len(certificate.unexplained) == certificate.null_vectors
    assert (certificate.rational_configurations > 0) == (
        not exact.robot.platform.planes
        and certificate.coefficients == "rational"
        and not any("sqrt" in line for line in certificate.recognised)
    )
    assert certificate.false_acceptance < 1e-15
    assert len(certificate.primes) >= 2
    assert certificate.unexplained == (("m_e",) if case in UNEXPLAINED else ())
    assert not certificate.lost or case == "3-PRS"  # at random directions
    assert f"rank {count} of" in certificate.summary()


def test_the_deltas_groupings_are_those_of_its_structure():
    """Cranks that turn about fixed axes, rods that carry masses at their ends."""
    base = pteron.base_parameters(pteron.load("delta"))
    assert base.expressions(symbols=True)[:4] == (
        "mgx_u1 + (lu1/ll1^2) I_l1",
        "mgy_u1",
        "I_u1 + (lu1^2/ll1^2) I_l1",
        "mgx_u2 + (lu1/ll1^2) I_l2",
    )
    assert base.expressions(symbols=True)[-1] == (
        "m_e + m_l1 - (1/ll1^2) I_l1 + m_l2 - (1/ll1^2) I_l2 + m_l3 - (1/ll1^2) I_l3"
    )


@pytest.mark.parametrize("case", gated([*PLAIN, *FAMILY, *TILTING], ("delta", "wrist")))
def test_a_turned_machine_has_the_same_base_parameters(case):
    robot, _, count = COUNTS[case]
    for seed in range(2 if case in PLAIN else 1):
        turned = pteron.turned(robot, Rotation.random(rng=seed).as_matrix())
        base = pteron.base_parameters(turned)
        assert base.rank == count
        assert base.names == found(case).names
        np.testing.assert_allclose(base.grouping, found(case).grouping, rtol=1e-13, atol=0)


@pytest.mark.parametrize("modes", [1, 6, 15])
def test_working_modes_share_their_base_parameters(modes):
    robot = pteron.load("quadrupteron")
    mode = pteron.working_modes(robot)[modes]
    np.testing.assert_array_equal(
        pteron.base_parameters(mode).grouping, pteron.base_parameters(robot).grouping
    )


@pytest.mark.parametrize("turn", [None, 5])
def test_roots_in_the_geometry_are_recognised(turn):
    robot = threefold()
    if turn is not None:
        robot = pteron.turned(robot, Rotation.random(rng=turn).as_matrix())
    base = pteron.base_parameters(robot)
    svd = pteron.base_parameters(robot, "svd")
    assert base.rank == svd.rank == 26
    assert base.certificate.coefficients == "algebraic"
    assert any("sqrt(3)" in line for line in base.certificate.recognised)
    assert base.names == svd.names
    np.testing.assert_allclose(base.grouping, svd.grouping, atol=1e-9 * np.abs(base.grouping).max())


def test_equal_distances_from_p_survive_when_the_points_are_no_simple_numbers():
    """Four platform points on a circle about P: m_e must be kept, whatever their directions."""
    robot = machine("quadrupteron", GENERIC)
    angles = np.radians([-90.0, 173.0, 71.0, 14.0])
    legs = tuple(
        replace(leg, platform_point=(0.04 * np.cos(a), 0.04 * np.sin(a), 0.0))
        for leg, a in zip(robot.legs, angles, strict=True)
    )
    base = pteron.base_parameters(replace(robot, legs=legs))
    assert base.rank == 28
    assert np.abs(base.grouping).max() < 1e4, "a broken circle shows as coefficients of 1e15"
    everything = ["m_l1", "m_l2", "m_l3", "m_l4"]
    with pytest.raises(pteron.ModelError, match="keep: m_l4"):
        pteron.base_parameters(replace(robot, legs=legs), keep=everything)


@pytest.mark.parametrize("gravity", [NONE, (0.0, -9.81, 0.0)])
def test_relations_of_special_guide_points_are_not_asked_of_others(gravity):
    """A five-bar with both cranks on one axis is a parallelogram: links turn as cranks do."""
    robot = machine("five-bar", gravity)
    legs = tuple(replace(leg, guide_point=(0.0, 0.0, 0.0)) for leg in robot.legs)
    for coaxial in (
        replace(robot, legs=legs),
        pteron.turned(replace(robot, legs=legs), Rotation.random(rng=6).as_matrix()),
    ):
        base, svd = (pteron.base_parameters(coaxial, method) for method in ("exact", "svd"))
        assert base.rank == svd.rank == (4 if gravity == NONE else 8)
        assert base.certificate.unexplained == ("mgx_l2", "mgy_l2", "m_e")
        assert base.certificate.rational_configurations == 0
        assert "special geometry" in base.certificate.summary()


def test_a_machine_whose_points_coincide_is_singular_everywhere():
    robot = machine("3-rrr")
    legs = tuple(replace(leg, platform_point=(0.1, 0.0, 0.0)) for leg in robot.legs)
    with pytest.raises(pteron.SingularPose, match="singular at every pose"):
        pteron.base_parameters(replace(robot, legs=legs))


def test_the_orthogonal_tripteron_has_a_relation_that_no_transfer_explains():
    base = pteron.base_parameters(machine("tripteron", GENERIC))
    assert base.certificate.unexplained == ("m_e",)
    assert {base.names[k] for k in np.flatnonzero(base.grouping[:, -4])} == {
        "m_p1",
        "m_p2",
        "m_p3",
    }
    assert "special geometry" in base.certificate.summary()


SHARED = ("quadrupteron, shared", "tripteron-oblique, shared", "delta, shared", "par4, shared")


@pytest.mark.parametrize(
    "case",
    gated(
        [*PLAIN, *FAMILY, *SHARED, "3-RRS, symmetric", "ankle"],
        (
            *("tripteron-oblique", "delta", "h4, its nacelle sliding"),
            *("the same with a shaft", SHARED[0], "ankle"),
        ),
    ),
)
def test_symbols_evaluate_to_the_exact_coefficients(case):
    base = found(case)
    exact = algebraic_values(exact_geometry(base.robot))
    numbers = base.expressions("sympy")
    ways = {True: base.geometry_values, "leg": base.leg_geometry_values}
    for symbols, known in list(ways.items())[: 1 + bool(base.shared_symbols)]:
        values = {symbol: exact[symbol] for symbol in known}
        sums = base.expressions("sympy", symbols=symbols)
        for symbolic, number in zip(sums, numbers, strict=True):
            names = sorted(number.free_symbols | symbolic.free_symbols, key=str)
            misfit = sympy.Poly(symbolic.subs(values) - number, *names)
            assert all(abs(sympy.N(c, 40)) < 1e-30 for c in misfit.coeffs())


def value_of(text, numbers):
    """Evaluate a text such as ``m_l1 - (1/(2*s1y)) mgx_e`` with Python's own arithmetic."""
    text = re.sub(r"(\)|\b[\d.]+(?:e[-+]?\d+)?) (?=[A-Za-z])", r"\1*", text).replace("^", "**")
    return eval(text, {"__builtins__": {}}, numbers)


def value_of_latex(text, numbers):
    """Evaluate what `expressions("latex")` prints, after rewriting it as Python."""
    text = re.sub(r"m_\{(\w+)\}\\gamma_\{\w+,([xy])\}", r"mg\2_\1", text)
    text = re.sub(r"\b([mI])_\{(\w+)\}", r"\1_\2", text)
    text = re.sub(r"\b([ls])_\{(\w+)\}", r"\1\2", text)
    text = text.replace(r"\left(", "(").replace(r"\right)", ")").replace(r"\,", " ")
    text = re.sub(r"\^\{(\d+)\}", r"**\1", text).replace("^", "**")
    while r"\frac" in text:
        text = re.sub(r"\\frac\{([^{}]*)\}\{([^{}]*)\}", r"((\1)/(\2))", text)
    text = re.sub(r"(?<=[\w)])\s+(?=[\w(])", "*", text)
    return eval(text, {"__builtins__": {}}, numbers)


@EVERY
def test_what_is_printed_evaluates_to_the_values(name):
    base = found(name)
    robot = base.robot
    parameters = dict(zip(pteron.parameter_names(robot), pteron.parameters(robot), strict=True))
    numbers = base.leg_geometry_values | {key: float(v) for key, v in parameters.items()}
    # Sums of large opposite terms: relative to the terms, not to what is left of them.
    scale = np.abs(base.grouping) @ np.abs(pteron.parameters(robot))
    for form, evaluate in (("text", value_of), ("latex", value_of_latex)):
        for symbols in (False, True, "leg")[: 2 + bool(base.shared_symbols)]:
            texts = base.expressions(form, symbols=symbols, digits=17)
            values = [evaluate(text, numbers) for text in texts]
            assert (np.abs(values - base.values()) <= 1e-12 * scale).all()


def test_a_legs_own_symbols_are_its_own():
    base = found("quadrupteron")
    lines = base.expressions(symbols="leg")
    assert lines[10] == "I_u3 + (lu3^2/ll3^2) I_l3"  # lu3 = ll3
    assert base.expressions(symbols=True)[10] == "I_u3 + I_l3"
    assert "lu4" in base.leg_geometry_values
    assert "lu4" not in base.geometry_values
    for number, line in zip("1234", lines[:4], strict=True):
        assert line == f"m_p{number} + m_u{number} + (1/ll{number}^2) I_l{number}"
    with pytest.raises(ModelError, match=r"^symbols: 'legs' is not True"):
        base.expressions(symbols="legs")


@pytest.mark.parametrize("symbols", [False, "leg"])
@pytest.mark.parametrize("name", ["quadrupteron", "delta", "five-bar"])
def test_the_table_for_a_paper_is_sound_latex(name, symbols, tmp_path):
    base = found(name)
    base = replace(base, robot=replace(base.robot, name="50 % of #1_a & {b}^~\\"))
    text = base.to_latex(symbols=symbols, digits=12)
    assert r"of 50 \% of \#1\_a \& \{b\}\textasciicircum{}\textasciitilde{}\text" in text
    body = text.partition(r"\midrule")[2].partition(r"\bottomrule")[0].strip().splitlines()
    assert len(body) == base.rank
    numbers = base.leg_geometry_values | dict(
        zip(pteron.parameter_names(base.robot), pteron.parameters(base.robot), strict=True)
    )
    for i, (row, value) in enumerate(zip(body, base.values(), strict=True), start=1):
        number, sums, printed, unit = re.fullmatch(
            r"\s*(\d+) & \$(.*)\$ & \$(.*)\$ & \$\\mathrm\{(.*)\}\$ \\\\", row
        ).groups()
        assert int(number) == i
        assert unit == base.parameters[base.kept[i - 1]].unit.replace(" ", r"\,")
        printed = re.sub(r" \\times 10\^\{(.*)\}", r"e\1", printed)
        np.testing.assert_allclose(float(printed), value, rtol=1e-11)
        sums = sums.replace(r"\begin{aligned}[t]", "").replace(r"\end{aligned}", "")
        sums = sums.replace("& ", "").replace(r" \\ ", " ").replace("tfrac", "frac").strip()
        np.testing.assert_allclose(value_of_latex(sums, numbers), value, rtol=1e-9)
    if program := shutil.which("pdflatex"):
        head = r"\documentclass{article}\usepackage{amsmath, booktabs}\begin{document}"
        whole = "\n".join([head, text, r"\end{document}"])
        (tmp_path / "table.tex").write_text(whole, encoding="utf-8")
        run = [program, "-interaction=nonstopmode", "-halt-on-error", "table.tex"]
        done = subprocess.run(run, cwd=tmp_path, capture_output=True, check=False)
        assert done.returncode == 0, done.stdout[-2000:]


@EVERY
def test_forces_follow_from_base_values_alone(name):
    base = found(name)
    robot = base.robot
    motion = states(robot, 50)
    matrices = base_regressor(robot, base, *motion)
    assert matrices.shape == (50, len(robot.legs), base.rank)
    forces = pteron.inverse_dynamics(robot, *motion)
    assert relative_error(matrices @ base.values(), forces) < 1e-11
    kernel = pteron.compile(robot, "inverse_dynamics", base=base)
    assert relative_error(kernel(*motion), forces) < 1e-11


def test_other_parameters_with_the_same_base_values_give_the_same_forces():
    """What is grouped cannot be told apart: move mass along a null direction, keep bodies real."""
    robot = pteron.load("quadrupteron")
    base = pteron.base_parameters(robot)
    values = pteron.parameters(robot)
    null = np.linalg.svd(base.grouping)[2][base.rank :]
    other = pteron.with_parameters(robot, values + 1e-3 * null.sum(axis=0))
    pose = pteron.random_poses(robot, 20)
    state = pose, np.ones_like(pose), np.ones_like(pose)
    forces = pteron.inverse_dynamics(robot, *state)
    assert not np.allclose(pteron.parameters(other), values, atol=1e-5)
    np.testing.assert_allclose(pteron.inverse_dynamics(other, *state), forces, rtol=1e-11)


def test_keep_chooses_the_columns():
    robot = pteron.load("quadrupteron")
    base = pteron.base_parameters(robot, keep=["I_l1", "m_l4", "I_e"])
    assert {"I_l1", "m_l4", "I_e"} <= set(base.names)
    assert base.rank == 26
    pose = pteron.random_poses(robot, 10)
    state = pose, np.ones_like(pose), np.ones_like(pose)
    forces = base_regressor(robot, base, *state) @ base.values()
    np.testing.assert_allclose(forces, pteron.inverse_dynamics(robot, *state), rtol=1e-10)


@pytest.mark.parametrize(
    ("keep", "message"),
    [
        (["mgx_u1"], "mgx_u1 cannot be kept"),
        (["m_p1", "m_u1"], "m_u1 cannot be kept"),
        (["nothing"], "'nothing' is no list of parameter names"),
        ("m_p1", r"keep: 'm_p1' given, a sequence \(each a text\) expected"),
    ],
)
def test_a_choice_that_cannot_be_is_refused(keep, message):
    with pytest.raises(pteron.PteronError, match=message):
        pteron.base_parameters(pteron.load("quadrupteron"), keep=keep)


def test_groups_of_legs_share():
    robot = machine("quadrupteron", GENERIC)
    base = pteron.base_parameters(robot, shared=[(2, 4)])
    assert "m_p(2,4)" in base.names
    assert base.rank == pteron.base_parameters(robot, "svd", shared=[(2, 4)]).rank < 28
    twin = replace(robot.legs[3], slider_mass=robot.legs[1].slider_mass)
    twin = replace(twin, upper=robot.legs[1].upper, lower=robot.legs[1].lower)
    twins = replace(robot, legs=(*robot.legs[:3], twin))
    pose = pteron.random_poses(twins, 10)
    state = pose, np.ones_like(pose), np.ones_like(pose)
    forces = base_regressor(twins, base, *state) @ base.values(twins)
    np.testing.assert_allclose(forces, pteron.inverse_dynamics(twins, *state), rtol=1e-10)
    with pytest.raises(pteron.ModelError, match="shared"):
        pteron.base_parameters(robot, shared=[(1, 5)])


def test_forms_of_the_output():
    base = pteron.base_parameters(pteron.load("quadrupteron"))
    assert base.expressions()[0] == "m_p1 + m_u1 + 20.11 I_l1"
    assert base.expressions(symbols=True)[4] == "I_u1 + (lu1^2/ll1^2) I_l1"
    assert base.expressions("latex")[5] == r"m_{u2}\gamma_{u2,x} + 5.941\, I_{l2}"
    first = base.expressions("sympy")[0]
    assert first.coeff(sympy.Symbol("I_l1")) == 1 / sympy.Rational("0.223") ** 2
    data = json.loads(base.to_json())
    assert data["rank"] == 26
    assert Fraction(data["shares"]["I_l1"]["m_p1"]) == 1 / Fraction("0.223") ** 2
    np.testing.assert_array_equal(data["grouping"], base.grouping)


def test_unknown_choices_are_refused():
    robot = pteron.load("quadrupteron")
    with pytest.raises(pteron.ModelError, match="method: 'lu'"):
        pteron.base_parameters(robot, "lu")
    with pytest.raises(pteron.ModelError, match="form: 'word'"):
        pteron.base_parameters(robot).expressions("word")
    with pytest.raises(pteron.ModelError, match='use method="exact"'):
        pteron.base_parameters(robot, "svd").expressions(symbols=True)
    other = pteron.base_parameters(pteron.load("tripteron"))
    with pytest.raises(pteron.ModelError, match="layout or gravity differ"):
        base_regressor(robot, other, np.zeros(4), np.zeros(4), np.zeros(4))


def test_a_machine_that_is_singular_everywhere_has_none():
    robot = pteron.load("quadrupteron")
    legs = tuple(replace(leg, platform_point=(0.0, 0.0, 0.0)) for leg in robot.legs)
    with pytest.raises(pteron.SingularPose, match="singular at every pose"):
        pteron.base_parameters(replace(robot, legs=legs))


def two_legs_along_k():
    """Two legs along the platform's axis: J is singular at every pose, by exact cancellation."""
    robot = machine("quadrupteron")
    first, second, third, _ = robot.legs
    twin = replace(first, platform_point=(0.05, 0.03, 0.0), guide_point=(0.05, -0.3, 0.0))
    return replace(robot, legs=(first, second, twin, third))


@pytest.mark.parametrize("seed", range(4))
def test_a_turned_machine_that_is_singular_everywhere_is_recognised(seed):
    turned = pteron.turned(two_legs_along_k(), Rotation.random(rng=seed).as_matrix())
    assert pteron.kinematics.is_singular_everywhere(turned)
    with pytest.raises(pteron.SingularPose):
        pteron.base_parameters(turned)


@pytest.mark.parametrize(
    ("name", "size"),
    [
        *(pytest.param("quadrupteron-oblique", size, marks=NIGHTLY) for size in (1e-3, 1e3)),
        *((name, size) for name in ("tripteron", "delta") for size in (1e-3, 1e3)),
    ],
)
def test_counts_do_not_depend_on_the_machines_size(name, size):
    robot = pteron.load(name)
    legs = tuple(
        replace(
            leg,
            guide_point=tuple(size * np.array(leg.guide_point)),
            platform_point=tuple(size * np.array(leg.platform_point)),
            upper_length=size * leg.upper_length,
            lower_length=size * leg.lower_length,
        )
        for leg in robot.legs
    )
    scaled = replace(robot, legs=legs)
    expected = pteron.base_parameters(robot).rank
    assert [pteron.base_parameters(scaled, method).rank for method in METHODS] == [expected] * 3


def tilted(angle):
    """An orthogonal Tripteron whose first direction is tilted by a small angle."""
    robot = machine("tripteron", GENERIC)
    d = (np.cos(angle), np.sin(angle) * 0.6, np.sin(angle) * 0.8)
    return replace(robot, legs=(replace(robot.legs[0], direction=d), *robot.legs[1:]))


@pytest.mark.parametrize(
    ("angle", "rank"),
    several(
        [(1e-12, 18), (5e-10, 18), (8e-9, 19), (2e-8, 19), (1e-6, 19), (1e-3, 19)],
        [(5e-10, 18), (8e-9, 19), (1e-3, 19)],
    ),
)
def test_a_right_angle_that_is_nearly_one(angle, rank):
    certificate = pteron.base_parameters(tilted(angle)).certificate
    assert certificate.rank == rank
    if rank == 18:
        assert any("d1" in line for line in certificate.recognised), "what was snapped is said"
    if 1e-9 <= angle < 1e-5:
        assert any("d1 and d2" in line for line in certificate.nearly)
        assert "perhaps meant to be" in certificate.summary()


def test_a_relation_that_exactness_loses_is_seen_in_floating_point():
    """Sliders along gravity's projections keep m_e dependent, which no right angle shows."""
    robot = machine("tripteron", (5.0, -6.0, -5.5))
    rng = np.random.default_rng(1)
    legs = []
    for leg in robot.legs:
        d = np.array(leg.direction)
        t = np.cross(d, rng.normal(size=3))
        t /= np.linalg.norm(t)
        g = np.array(robot.gravity)
        e = (g @ d) * d + (g @ t) * t
        legs.append(replace(leg, slider_direction=tuple(e / np.linalg.norm(e))))
    certificate = pteron.base_parameters(replace(robot, legs=tuple(legs))).certificate
    assert (certificate.rank, certificate.numerical_rank) == (19, 18)
    assert "IN FLOATING POINT the rank of the machine is 18" in certificate.summary()


@pytest.mark.parametrize(
    ("angle", "rank", "numerical_rank"),
    several(
        [
            *((1e-12, 26, 26), (1e-10, 26, 26), (1e-9, 26, 27)),
            *((3e-9, 28, 28), (1e-7, 28, 28), (1e-6, 28, 28)),
        ],
        [(1e-10, 26, 26), (1e-9, 26, 27), (3e-9, 28, 28)],
    ),
)
def test_floats_are_not_said_to_agree_where_what_they_drop_is_no_rounding(
    angle, rank, numerical_rank
):
    """Gravity barely off leg 1's d: two columns act by 0.8 and 2.8 times the angle."""
    size = 9.81 * np.sin(angle)
    gravity = (0.6 * size, 0.8 * size, -9.81 * np.cos(angle))
    base = pteron.base_parameters(machine("quadrupteron", gravity))
    numerical, summary = base.certificate.numerical, base.certificate.summary()
    assert (base.rank, numerical.rank) == (rank, numerical_rank)
    assert f"largest dropped {numerical.largest_dropped:.1e})" in summary
    svd = pteron.base_parameters(machine("quadrupteron", gravity), "svd").certificate
    assert svd.rank == numerical_rank
    if rank == 28:
        assert numerical.largest_dropped < 1e-15 < 1e-3 < numerical.smallest_kept
        assert f"is {numerical}: the same." in summary
        return
    assert ": the same." not in summary
    assert 1e-13 < numerical.largest_dropped < 1e-10
    assert "WHAT WAS DROPPED IS MORE THAN ROUNDING (1e-13)" in svd.summary()
    if numerical_rank == rank:
        assert "WHAT WAS DROPPED IS MORE THAN ROUNDING (1e-13), so that floating point" in summary
    else:
        assert f"IN FLOATING POINT the rank of the machine is {numerical}" in summary


@pytest.mark.parametrize("case", gated([*FEW[:3], *FAMILY], ["delta-4"]))
def test_the_cheapest_base_parameters_give_the_same_forces(case):
    plain = found(case)
    robot = plain.robot
    base = pteron.reduction.cheapest_parameters(robot)
    kernels = [
        pteron.compile(robot, "inverse_dynamics", base=b, grade="parametric") for b in (base, plain)
    ]
    motion = states(robot, 50)
    forces = pteron.inverse_dynamics(robot, *motion)
    assert all(relative_error(kernel(*motion), forces) < 1e-11 for kernel in kernels)
    assert base.rank == plain.rank
    cheapest, other = (kernel.operations for kernel in kernels)
    assert cheapest <= other


def test_the_cheapest_base_parameters_of_a_nearly_symmetric_machine():
    first, last = TILTED["ankle"].legs
    point = (last.platform_point[0] + 1e-8, *last.platform_point[1:])
    robot = replace(TILTED["ankle"], legs=(first, replace(last, platform_point=point)))
    base = pteron.reduction.cheapest_parameters(robot)
    assert base.rank == pteron.base_parameters(robot).rank == 17
    motion = tilting.states(robot, pteron.workspace.home_pose(robot), 20)
    found = pteron.compile(robot, "inverse_dynamics", base=base)(*motion)
    assert relative_error(found, pteron.inverse_dynamics(robot, *motion)) < 1e-9


def test_tiny_gravity_counts():
    robot = machine("tripteron", (0.0, 0.0, -4e-7))
    assert pteron.base_parameters(robot).rank == 16


def test_a_base_of_another_layout_is_refused():
    robot = machine("quadrupteron")
    longer = replace(robot.legs[1], lower_length=0.17)
    other = replace(robot, legs=(robot.legs[0], longer, *robot.legs[2:]))
    base = pteron.base_parameters(other)
    with pytest.raises(pteron.ModelError, match="layout or gravity differ"):
        base_regressor(robot, base, np.zeros(4), np.zeros(4), np.zeros(4))
    mode = pteron.working_modes(robot)[5]
    own = pteron.base_parameters(robot)
    assert base_regressor(mode, own, np.zeros(4), np.zeros(4), np.zeros(4)).shape == (4, 26)


@pytest.mark.parametrize("shared", [[1, 2], [(1.0, 2)], 3, [(1, 2), (2, 3)], "all", [("1",)]])
def test_groups_that_are_none_are_refused(shared):
    with pytest.raises(pteron.PteronError, match=r"^shared: "):
        pteron.base_parameters(machine("quadrupteron"), shared=shared)


TIED = {
    "quadrupteron-oblique": 11,
    "tripteron-oblique": 8,
    "3-rrr": 10,
    "3-rpr": 10,
    "3-prr": 8,
    "stewart": 24,
    "hexa": 27,
    "hexaglide": 21,
}
"""Machines whose legs share their parameters, and the minimal parameters that M. Schappler's
robsynth-parroblib (github.com/SchapplM) lists for their topologies, grouped along a leg alone."""


@pytest.mark.parametrize("name", gated(TIED, ["3-rrr", "stewart"], CLIENTS))
def test_tied_legs_have_at_most_the_parameters_of_one_leg_and_the_platform(name):
    """The loop may group more than a leg by itself does, and never less."""
    assert pteron.base_parameters(name, shared=True).rank <= TIED[name]


ONE_LENGTH = {"quadrupteron-oblique": 10, "tripteron-oblique": 7, "3-rrr": 9, "3-rpr": 9} | {
    "3-prr": 7,
    "stewart": 13,
    "hexa": 14,
    "hexaglide": 12,
}
"""The same with links of one length: each has one parameter less than its legs alone tell."""


@pytest.mark.parametrize("name", gated(ONE_LENGTH, ["quadrupteron-oblique", "hexaglide"], CLIENTS))
def test_the_loop_of_tied_legs_moves_their_mass_at_platform_points_to_the_platform(name):
    robot = pteron.load(name)
    if "oblique" in name:
        legs = (replace(leg, upper_length=0.19, lower_length=0.2) for leg in robot.legs)
        robot = replace(robot, legs=tuple(legs), home=None)
    base = pteron.base_parameters(robot, shared=True)
    assert base.rank == ONE_LENGTH[name]
    x, y, z = np.array([leg.platform_point for leg in robot.legs]).T
    moved = dict.fromkeys(pteron.parameter_names(robot), 0.0)
    moved |= {name: -1.0 for name in moved if name.startswith("m_l")}
    moved |= {
        "m_e": float(len(x)),
        "mgx_e": x.sum(),
        "mgy_e": y.sum(),
        "I_e": (x * x + y * y).sum(),
    }
    moved |= {"mgz_e": z.sum(), "Ixx_e": (y * y + z * z).sum(), "Iyy_e": (x * x + z * z).sum()}
    moved |= {"Izz_e": moved["I_e"], "Ixy_e": -x @ y, "Ixz_e": -x @ z, "Iyz_e": -y @ z}
    change = [moved[name] for name in pteron.parameter_names(robot)]
    np.testing.assert_allclose(base.grouping @ change, 0.0, atol=1e-12)
