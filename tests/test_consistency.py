"""Real bodies for identified base parameters: identities, bounds, distances, messages."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from logs_of_motions import machine
from mechanisms import CATALOG, CLIENTS, states
from scipy.optimize import minimize
from scipy.stats import chi2

import pteron
from pteron.bodies.parameters import body_places
from pteron.identification.consistency import Bounds, Consistency, consistent_model, real_bodies
from pteron.identification.plausibility import usual_sizes
from pteron.manipulator import parameter_data

pytest.importorskip("clarabel")

QUADRUPTERON = CATALOG["quadrupteron"]
SOME = [
    "quadrupteron turned",
    "quadrupteron-oblique +--+",
    "tripteron",
    "random 3T1R 1",
    "random 3T 0",
    "delta",
    "mixed",
    "five-bar",
    "delta-4",
]
BASES = {}


def base_of(robot, shared=False):
    key = robot, str(shared)
    if key not in BASES:
        BASES[key] = pteron.base_parameters(robot, "svd", shared=shared)
    return BASES[key]


def reproduces(result, base, values):
    """Return the relative error of the returned machine's base parameters."""
    found = base.values(result.robot)
    size = usual_sizes(base, result.parameters)
    return float((np.abs(found - values) / size).max())


def disturbed(robot, seed, by=0.2):
    """Return parameters of real bodies, each up to `by` off in mass, centre and inertia."""
    rng = np.random.default_rng(seed)
    values = pteron.parameters(robot)
    # A slider has a mass, a rod m, mgx and I, other bodies all four.
    for place in body_places(parameter_data(robot)).values():
        m, *moments = values[list(place.values())]
        mass = m * rng.uniform(1 - by, 1 + by)
        if moments:
            *first, inertia = moments
            about_center = inertia - np.dot(first, first) / m
            first = mass * np.array(first) / m * rng.uniform(1 - by, 1 + by, len(first))
            about_center *= rng.uniform(1 - by, 1 + by)
            moments = [*first, about_center + first @ first / mass]
        values[list(place.values())] = [mass, *moments]
    assert real_bodies(robot, values) == ()
    return values


@pytest.mark.parametrize("name", SOME)
def test_exact_values_give_the_cad_model_back(name):
    robot = machine(name)
    base = base_of(robot)
    result = consistent_model(robot, base, base.values())
    assert isinstance(result, Consistency)
    assert result.feasible
    assert result.distance == 0.0
    assert result.cad_feasible
    assert reproduces(result, base, base.values()) < 1e-12
    assert result.residual < 1e-12
    np.testing.assert_allclose(result.parameters, pteron.parameters(robot), rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", SOME)
def test_a_wrong_cad_model_does_not_keep_the_forces_from_being_right(name):
    robot = machine(name)
    base = base_of(robot)
    prior = disturbed(robot, 3)
    for cad in (prior, pteron.with_parameters(robot, prior), None):
        result = consistent_model(robot, base, base.values(), cad=cad)
        assert result.feasible
        assert result.cad_feasible
        assert result.nearest_to == ("nothing" if cad is None else "CAD")
        assert real_bodies(robot, result.parameters) == ()
        assert reproduces(result, base, base.values()) < 1e-12
        pose, velocity, acceleration = states(robot, 20)
        np.testing.assert_allclose(
            pteron.inverse_dynamics(result.robot, pose, velocity, acceleration),
            pteron.inverse_dynamics(robot, pose, velocity, acceleration),
            rtol=1e-9,
            atol=1e-9,
        )


@pytest.mark.parametrize(("name", "groups"), [("tripteron", True), ("random 3T1R 0", [(1, 3)])])
def test_legs_that_share_parameters_keep_sharing_them(name, groups):
    robot = machine(name)
    base = base_of(robot, groups)
    legs = range(len(robot.legs)) if groups is True else [0, 2]
    first = robot.legs[0]
    alike = [
        replace(leg, slider_mass=first.slider_mass, upper=first.upper, lower=first.lower)
        if i in legs
        else leg
        for i, leg in enumerate(robot.legs)
    ]
    true = replace(robot, legs=tuple(alike))
    for cad in ("robot", disturbed(robot, 1), None):
        result = consistent_model(robot, base, base.values(true), cad=cad)
        assert result.feasible
        assert reproduces(result, base, base.values(true)) < 1e-12
        assert (
            len({(result.robot.legs[i].slider_mass, result.robot.legs[i].upper) for i in legs}) == 1
        )
    again = consistent_model(robot, base, base.values(true), cad=true)
    np.testing.assert_allclose(again.parameters, pteron.parameters(true), rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", ["quadrupteron", "tripteron-oblique"])
def test_values_of_no_real_bodies_are_told_with_their_distance(name):
    robot = CATALOG[name]
    base = base_of(robot)
    values = base.values()
    rng = np.random.default_rng(0)
    mix = rng.normal(size=(base.rank, base.rank)) / 20 + np.eye(base.rank)
    root = np.diag(0.01 * np.abs(values) + 1e-5) @ mix
    covariance = root @ root.T
    # A sum of masses and inertias cannot be negative.
    values[base.names.index("m_p1")] = -0.1
    result = consistent_model(robot, base, values, covariance)
    assert not result.feasible
    shift = result.base_values - values
    assert result.distance == pytest.approx(
        np.sqrt(shift @ np.linalg.solve(covariance, shift)), rel=1e-9
    )
    assert result.distance > 5
    assert result.p_value == pytest.approx(chi2.sf(result.distance**2, base.rank))
    np.testing.assert_allclose(result.shifts, shift / np.sqrt(np.diag(covariance)), rtol=1e-9)
    assert "p1" in result.at_border
    assert real_bodies(robot, result.parameters) == ()
    assert "standard deviations away" in result.summary()
    # No real bodies tried at random are closer.
    for seed in range(200):
        other = base.grouping @ disturbed(robot, seed, 0.5) - values
        assert other @ np.linalg.solve(covariance, other) > result.distance**2


def test_a_body_that_turns_about_any_axis_is_real_by_its_second_moments():
    robot = pteron.load("ball-table")
    base = base_of(robot)
    values = base.values()
    same = consistent_model(robot, base, values)
    assert (same.feasible, same.distance) == (True, 0.0)
    # A flat plate is at the border of what is real, and is kept just inside.
    np.testing.assert_allclose(same.parameters, pteron.parameters(robot), rtol=0, atol=1e-4)
    # The least of its three second moments is below zero: Ixx + Iyy < Izz.
    bad = pteron.parameters(robot)
    place = body_places(parameter_data(robot))["e"]
    bad[place["Izz"]] = 1.1 * (bad[place["Ixx"]] + bad[place["Iyy"]])
    assert "belongs to no real body" in real_bodies(robot, bad)[0]
    wanted = base.grouping @ bad
    spread = np.diag((1e-3 * usual_sizes(base, bad)) ** 2)
    found = consistent_model(robot, base, wanted, spread, cad=None)
    assert not found.feasible
    assert found.distance > 5.0
    assert "e" in found.at_border
    assert real_bodies(robot, found.parameters) == ()
    box = Bounds(boxes={"e": ((-0.2, 0.2), (-0.2, 0.2), (-0.05, 0.1))})
    held = consistent_model(robot, base, values, cad=None, bounds=box)
    assert held.feasible
    moments = np.array(
        held.robot.platform.inertia.second_moments(
            dict(
                zip(
                    held.robot.platform.inertia.kinds,
                    held.robot.platform.inertia.values,
                    strict=True,
                )
            )
        )
    )
    assert moments[2, 2] <= 0.05 * moments[2, 3] + 0.005 * moments[3, 3] + 1e-9


def test_without_a_covariance_the_distance_is_relative():
    base = base_of(QUADRUPTERON)
    values = base.values()
    values[0] = -0.1
    result = consistent_model(QUADRUPTERON, base, values)
    assert not result.feasible
    assert result.metric == "relative"
    assert np.isnan(result.p_value)
    assert "no covariance" in result.summary()


@CLIENTS
def test_the_projection_against_a_general_optimiser():
    """An interior-point method on a Tripteron whose legs share: 13 unknowns, 3 bodies."""
    robot = CATALOG["tripteron"]
    base = base_of(robot, True)
    values = base.values()
    values[base.names.index("m_p")] = 0.05
    deviations = 0.05 * np.abs(base.values()) + 1e-4
    result = consistent_model(robot, base, values, np.diag(deviations**2))
    assert not result.feasible
    n = len(robot.legs)
    lengths = [robot.legs[0].upper_length, robot.legs[0].lower_length, 0.05]
    scale = np.array([1.0, *(s**k for s in lengths for k in (0, 1, 1, 2))])
    spread = np.zeros((9 * n + 4, 13))
    for i in range(n):
        spread[i, 0] = 1.0
        spread[n + 4 * i : n + 4 * i + 4, 1:5] = np.eye(4)
        spread[5 * n + 4 * i : 5 * n + 4 * i + 4, 5:9] = np.eye(4)
    spread[-4:, 9:] = np.eye(4)
    grouping = base.grouping @ spread * scale / deviations[:, None]

    def real(z):
        m, hx, hy, inertia = z[1:].reshape(-1, 4).T
        return np.concatenate([z[:1], m, inertia, m * inertia - hx**2 - hy**2])

    def squared(z):
        return float(np.sum((grouping @ z - values / deviations) ** 2))

    drawn = [*robot.legs[0].upper.values, *robot.legs[0].lower.values]
    drawn += robot.platform.inertia.values
    found = minimize(
        squared,
        np.array([robot.legs[0].slider_mass, *drawn]) / scale,
        jac=lambda z: 2 * grouping.T @ (grouping @ z - values / deviations),
        constraints={"type": "ineq", "fun": real},
        method="trust-constr",
        options={"maxiter": 3000},
    )
    assert result.distance == pytest.approx(np.sqrt(found.fun), rel=2e-3)


def test_the_nearest_model_against_the_closed_form():
    """Where no body is at its border the nearest model is a least-norm correction."""
    base = base_of(QUADRUPTERON)
    values = base.values() * 1.001
    result = consistent_model(QUADRUPTERON, base, values)
    assert result.at_border == ()
    cad = pteron.parameters(QUADRUPTERON)
    lengths = [leg.upper_length for leg in QUADRUPTERON.legs]
    lengths += [leg.lower_length for leg in QUADRUPTERON.legs]
    lengths.append(0.04)
    masses = cad[4::4]
    units = masses[:, None] * np.array(lengths)[:, None] ** np.array([0, 1, 1, 2])
    scale = np.concatenate([cad[:4], units.ravel()])
    step = np.linalg.pinv(base.grouping * scale) @ (values - base.values())
    np.testing.assert_allclose(result.parameters, cad + scale * step, rtol=1e-6, atol=1e-9)


def test_bounds_hold_and_can_be_active():
    base = base_of(QUADRUPTERON)
    cad = pteron.parameters(QUADRUPTERON)
    names = pteron.parameter_names(QUADRUPTERON)
    box = ((-0.06, 0.06), (-0.06, 0.06))
    total = sum(v for v, name in zip(cad, names, strict=True) if name.startswith("m_"))
    bounds = Bounds(
        lower={"m_u": 0.37},
        upper={"I_l2": 0.0021},
        boxes={"e": box, "l": ((-0.3, 0.05), (-0.05, 0.05))},
        total_mass=(0.9 * total, 1.5 * total),
    )
    result = consistent_model(QUADRUPTERON, base, base.values(), bounds=bounds)
    assert result.feasible
    got = dict(zip(names, result.parameters, strict=True))
    assert got["m_u2"] == pytest.approx(0.37, rel=1e-6)
    assert got["I_l2"] <= 0.0021 * (1 + 1e-6)
    assert reproduces(result, base, base.values()) < 1e-12
    assert "m_u2 >= 0.37" in result.at_border
    # The machine's own masses are below 0.37 kg: its CAD model is what does not keep them.
    assert not result.cad_feasible
    assert any(line.startswith("m_u2 >= 0.37: by 0.05") for line in result.cad_violations)
    assert "nothing against the fit" in result.summary()


def test_a_rod_has_its_centre_of_mass_between_its_ends():
    robot = CATALOG["delta"]
    base = base_of(robot)
    values = pteron.parameters(robot)
    names = pteron.parameter_names(robot)
    # The drawing says so of a rod that it has it beyond its tip.
    beyond = values.copy()
    length = robot.legs[0].lower_length
    beyond[names.index("mgx_l1")] = -1.1 * length * values[names.index("m_l1")]
    beyond[names.index("I_l1")] = 1.3 * length**2 * values[names.index("m_l1")]
    result = consistent_model(robot, base, base.values(), cad=beyond)
    assert not result.cad_feasible
    assert "centre after its tip" in result.cad_violations[0]
    assert result.feasible
    for leg in result.robot.legs:
        (x,) = leg.lower.center_of_mass
        assert -leg.lower_length * (1.0 + 1e-7) <= x <= 1e-9
    assert reproduces(result, base, base.values()) < 1e-12


def test_a_small_box_makes_a_fit_infeasible_and_says_which():
    base = base_of(QUADRUPTERON)
    tight = ((-0.001, 0.001), (-0.001, 0.001))
    covariance = np.diag((0.01 * np.abs(base.values()) + 1e-6) ** 2)
    bounds = Bounds(boxes={"l2": tight})
    result = consistent_model(QUADRUPTERON, base, base.values(), covariance, bounds=bounds)
    assert not result.feasible
    assert any(name.startswith("box of l2") for name in result.at_border)
    body = result.robot.legs[1].lower
    assert np.abs(body.center_of_mass).max() <= 0.001 * (1 + 1e-3)


@pytest.mark.parametrize(
    ("bounds", "text"),
    [
        ({"lower": {"m_e": 2.0}, "upper": {"m_e": 1.0}}, "m_e: lower limit 2 is above"),
        ({"boxes": {"e": ((1.0, 0.0), (0.0, 1.0))}}, "box of e, x: lower limit"),
        ({"boxes": {"e": (1.0, 2.0)}}, "box of e: .* is not"),
        ({"lower": {"m_x": 1.0}}, "'m_x' is no parameter of this machine: m_p1,"),
        ({"boxes": {"x1": ((0, 1), (0, 1))}}, "'x1' is no body of this machine: u1,"),
        ({"lower": {"m_p1": np.nan}}, "m_p1: nan is not a number"),
        ({"lower": {"m_p1": 2.0}, "total_mass": (0.0, 1.0)}, "no real bodies keep them all"),
    ],
)
def test_bounds_that_cannot_be_are_one_line(bounds, text):
    base = base_of(QUADRUPTERON)
    with pytest.raises(pteron.ModelError, match=text) as error:
        consistent_model(QUADRUPTERON, base, base.values(), bounds=Bounds(**bounds))
    assert "\n" not in str(error.value)


def test_an_unreal_cad_array_is_told_apart_from_the_fit():
    base = base_of(QUADRUPTERON)
    cad = pteron.parameters(QUADRUPTERON)
    names = pteron.parameter_names(QUADRUPTERON)
    cad[names.index("I_u2")] *= 0.3
    cad[names.index("m_p3")] = -0.2
    result = consistent_model(QUADRUPTERON, base, base.values(), cad=cad)
    assert result.feasible
    assert not result.cad_feasible
    assert [line.split(":")[0] for line in result.cad_violations] == ["p3", "u2"]
    assert reproduces(result, base, base.values()) < 1e-12
    assert "CAD: the CAD model itself" in result.summary()
    assert "exactly" in result.summary()

    wrong = base.values()
    wrong[0] = -0.1
    both = consistent_model(QUADRUPTERON, base, wrong, cad=cad)
    assert not both.feasible
    assert not both.cad_feasible


def test_an_unreal_file_names_itself_and_the_body(tmp_path):
    path = tmp_path / "unreal.toml"
    pteron.save(QUADRUPTERON, path)
    text = path.read_text()
    assert text.count("inertia = 0.0021\n") == 1
    path.write_text(text.replace("inertia = 0.0021\n", "inertia = 0.00001\n"))
    with pytest.raises(pteron.ModelError, match=r"unreal\.toml.*platform.*too far out"):
        pteron.load(path)


def test_the_result_is_a_model_file(tmp_path):
    base = base_of(QUADRUPTERON)
    values = base.values()
    values[0] = -0.1
    for given in (base.values(), values):
        result = consistent_model(QUADRUPTERON, base, given, cad=disturbed(QUADRUPTERON, 2))
        path = tmp_path / "consistent.toml"
        pteron.save(result.robot, path)
        np.testing.assert_allclose(
            base.values(pteron.load(path)), result.base_values, rtol=0, atol=1e-12
        )


def test_a_missing_library_is_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "clarabel", None)
    base = base_of(QUADRUPTERON)
    with pytest.raises(pteron.ModelError, match=r"-m pip install .*\[consistency\]") as error:
        consistent_model(QUADRUPTERON, base, base.values())
    assert "\n" not in str(error.value)


def test_input_is_checked():
    base = base_of(QUADRUPTERON)
    values, rank = base.values(), base.rank
    for bad in (values[:-1], np.full(rank, np.nan)):
        with pytest.raises(pteron.DataError, match="values"):
            consistent_model(QUADRUPTERON, base, bad)
    skew = np.eye(rank)
    skew[0, 1] = 0.5
    for bad in (np.eye(3), -np.eye(rank), np.ones((rank, rank)), skew):
        with pytest.raises(pteron.DataError, match="covariance"):
            consistent_model(QUADRUPTERON, base, values, bad)
    with pytest.raises(pteron.ModelError, match="cad"):
        consistent_model(QUADRUPTERON, base, values, cad=np.ones(3))
    with pytest.raises(pteron.ModelError, match=r"cad\.toml: neither a file"):
        consistent_model(QUADRUPTERON, base, values, cad="cad.toml")
    with pytest.raises(pteron.ModelError, match="base"):
        consistent_model(CATALOG["tripteron"], base, values)


@pytest.mark.parametrize("name", ["quadrupteron", "random 3T1R 1"])
@pytest.mark.parametrize(("noise", "seed"), [(0.5, 0), (10.0, 1), (100.0, 2)])
def test_forces_differ_from_the_free_fit_by_little_of_the_residual(name, seed, noise):
    """Below 5 % of the residual, with noise (N) that leaves the free fit real, or far from it."""
    robot = machine(name)
    base = base_of(robot)
    count = 3000
    matrix = pteron.base_regressor(robot, base, *states(robot, count, seed)).reshape(-1, base.rank)
    rng = np.random.default_rng(seed)
    forces = matrix @ base.values() + noise * rng.normal(size=len(matrix))
    values = np.linalg.lstsq(matrix, forces, rcond=None)[0]
    residual = forces - matrix @ values
    variance = residual @ residual / (len(matrix) - base.rank)
    covariance = variance * np.linalg.inv(matrix.T @ matrix)
    result = consistent_model(robot, base, values, covariance, cad=disturbed(robot, seed))
    difference = matrix @ (result.base_values - values)
    assert np.linalg.norm(difference) < 0.05 * np.linalg.norm(residual)
    assert np.linalg.norm(difference) / np.sqrt(variance) == pytest.approx(
        result.distance, rel=1e-6, abs=1e-6
    )
    if noise < 1.0:
        assert result.feasible
    if noise == 100.0 and name == "quadrupteron":
        # Else the comparison above would hold for nothing.
        assert not result.feasible
        assert np.linalg.norm(difference) > 0.0
