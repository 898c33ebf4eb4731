"""Exact numbers, elimination modulo a prime, and geometry that stays exact when it is turned."""

import math
import random
from dataclasses import replace
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
import sympy
from hypothesis import assume, example, given, settings, strategies as st
from mechanisms import CATALOG, MECHANISMS, random_machine
from scipy.spatial.transform import Rotation

import pteron
from pteron.kernels import NoSquareRoot, PrimeField, RationalField, evaluate
from pteron.reduction.elimination import dependencies, reconstruct, remainder
from pteron.reduction.exact_geometry import exact_geometry
from pteron.reduction.exact_regressor import is_square
from pteron.reduction.surds import Surd, direction_cosine, length

PRIMES = (2**61 - 1, 2**89 - 1, 2**107 - 1)
PRIME = PRIMES[0]
SETTINGS = settings(deadline=None, derandomize=True)

fractions = st.fractions(-50, 50, max_denominator=200)


def squarefree(s):
    return all(power == 1 for power in sympy.factorint(s).values())


radicands = st.integers(1, 400).filter(squarefree)


# Surds.


@SETTINGS
@given(fractions.filter(lambda q: q > 0), st.sampled_from([1.0, -1.0]))
def test_the_root_of_a_fraction(square, sign):
    root = Surd.root(square, sign)
    assert root.square == square
    assert squarefree(root.s)
    assert float(root) == pytest.approx(sign * math.sqrt(square), rel=1e-15)
    assert (root.q > 0) == (sign > 0)


@SETTINGS
@given(fractions, radicands, fractions)
def test_a_surd_times_a_fraction(q, s, factor):
    surd = Surd(q, s)
    assert surd.times(factor).square == surd.square * factor**2
    assert float(surd.times(factor)) == pytest.approx(float(surd) * float(factor), rel=1e-14)
    assert sympy.sympify(str(surd).replace(" sqrt", "*sqrt")) == sympy.Rational(
        q.numerator, q.denominator
    ) * sympy.sqrt(s)


@SETTINGS
@given(fractions, radicands)
def test_a_surd_within_a_prime_field(q, s):
    field = PrimeField(PRIME)
    assume(all(is_square(p, PRIME) for p in sympy.factorint(s)))
    value = Surd(q, s).field_element(field)
    assert field.multiply(value, value) == field.number(q * q * s)


def test_roots_multiply_within_every_field():
    """Sqrt(2) sqrt(3) = sqrt(6), whichever of its two roots the field takes of each."""
    primes = [p for p in sympy.primerange(10_000, 20_000) if p % 4 == 3]
    served = 0
    for prime in primes:
        if all(is_square(p, prime) for p in (2, 3, 5)):
            field = PrimeField(prime)
            two, three, six = (Surd(Fraction(1), s).field_element(field) for s in (2, 3, 6))
            assert field.multiply(two, three) == six
            served += 1
    assert served > 50


def test_a_root_within_the_rational_numbers_must_be_rational():
    assert Surd(Fraction(2, 3)).field_element(RationalField()) == Fraction(2, 3)
    with pytest.raises(NoSquareRoot):
        Surd(Fraction(2, 3), 5).field_element(RationalField())


@SETTINGS
@given(st.integers(1, 300), st.data(), st.booleans(), st.sampled_from([1, -1]))
def test_a_cosine_is_recognised(denominator, data, plain, sign):
    numerator = data.draw(st.integers(0, denominator))
    part = Fraction(numerator, denominator)
    value = sign * (float(part) if plain else math.sqrt(part))
    found = direction_cosine(value)
    assert found is not None
    # Numbers 1e-9 from a simple one count as it; squares of denominator 300 are 1e-5 apart.
    assert found.square == (part * part if plain else part)
    assert float(found) == pytest.approx(value, abs=1e-15)


@SETTINGS
@given(st.integers(0, 10**6), st.sampled_from([1, -1]))
def test_a_decimal_to_the_micrometre_is_a_length(micrometres, sign):
    exact = Fraction(sign * micrometres, 10**6)
    assert length(float(exact)) == Surd(exact)


@pytest.mark.parametrize(
    ("value", "square"), [(math.sqrt(0.0032), Fraction(2, 625)), (0.04 * math.sqrt(3), "0.0048")]
)
def test_the_root_of_a_decimal_is_a_length(value, square):
    found = length(value)
    assert found is not None
    assert found.square == Fraction(square)


def test_numbers_that_are_not_simple_are_not_taken_for_any():
    rng = np.random.default_rng(0)
    cosines = rng.uniform(-1, 1, 2000)
    # Odds of 1e-4 each, by the docstring, and half as many again for the squares.
    assert sum(direction_cosine(float(v)) is not None for v in cosines) <= 2
    assert sum(length(float(v)) is not None for v in rng.uniform(0.1, 1, 2000)) <= 2
    assert direction_cosine(1 / math.pi) is None
    assert length(1 / math.pi) is None


# Elimination.

matrices = st.integers(1, 6).flatmap(
    lambda n: st.lists(st.lists(st.integers(-9, 9), min_size=n, max_size=n), min_size=1, max_size=7)
)


@settings(deadline=None, derandomize=True, max_examples=80)
@given(matrices, st.randoms(use_true_random=False))
@example([[0, 0], [0, 0]], None)
def test_dependencies_against_sympy(rows, shuffler):
    columns = len(rows[0])
    order = list(range(columns))
    if shuffler is not None:
        shuffler.shuffle(order)
    kept, given_by = dependencies(rows, order, PRIME)
    matrix = sympy.Matrix(rows)
    # Minors of a 6x6 matrix of digits are far below the prime: the ranks agree.
    assert len(kept) == matrix.rank()
    assert kept == [c for c in order if c in kept]
    pivots = matrix[:, order].rref()[1]
    assert kept == [order[p] for p in pivots]
    assert set(kept) | set(given_by) == set(order)
    assert not set(kept) & set(given_by)
    for column, terms in given_by.items():
        assert set(terms) <= set(kept)
        assert all(0 < share < PRIME for share in terms.values())
        assert all(order.index(k) < order.index(column) for k in terms)
        for row in rows:
            assert (row[column] - sum(share * row[k] for k, share in terms.items())) % PRIME == 0


def test_preferred_columns_are_kept():
    rows = [[1, 1, 0], [0, 0, 1]]
    assert dependencies(rows, [0, 1, 2], PRIME) == ([0, 2], {1: {0: 1}})
    assert dependencies(rows, [1, 0, 2], PRIME) == ([1, 2], {0: {1: 1}})
    assert dependencies([[2, 3]], [0, 1], 7) == ([0], {1: {0: 5}})


def test_the_rows_given_are_not_changed():
    rows = [[1, 2], [3, 4]]
    dependencies(rows, [1, 0], PRIME)
    assert rows == [[1, 2], [3, 4]]


@SETTINGS
@given(st.integers(-(10**40), 10**40))
def test_chinese_remainders(number):
    total, modulus = remainder([number % p for p in PRIMES], PRIMES)
    assert modulus == math.prod(PRIMES)
    assert total == number % modulus


def test_no_remainders():
    assert remainder([], []) == (0, 1)
    with pytest.raises(ValueError, match="zip"):
        remainder([1, 2], [PRIME])


@SETTINGS
@given(st.integers(-(10**9) + 1, 10**9), st.integers(1, 10**9))
def test_a_fraction_is_reconstructed(numerator, denominator):
    fraction = Fraction(numerator, denominator)
    # Both are below sqrt(2^61 / 2) = 1.07e9.
    assert reconstruct(PrimeField(PRIME).number(fraction), PRIME) == fraction


@SETTINGS
@given(st.fractions(max_denominator=10**30).filter(lambda f: abs(f.numerator) < 10**35))
def test_a_long_fraction_is_reconstructed_from_several_primes(fraction):
    residues = [PrimeField(p).number(fraction) for p in PRIMES]
    assert reconstruct(*remainder(residues, PRIMES)) == fraction


@SETTINGS
@given(st.integers(0, PRIME - 1))
def test_what_is_reconstructed_is_small_and_congruent(value):
    found = reconstruct(value, PRIME)
    if found is not None:
        bound = math.isqrt(PRIME // 2)
        assert max(abs(found.numerator), found.denominator) <= bound
        assert (found.numerator - value * found.denominator) % PRIME == 0


def test_some_residues_are_of_no_small_fraction():
    """Of p residues at most (2 B + 1) B fractions' are taken, B^2 = p / 2; hence some are not."""
    missing = [v for v in range(103) if reconstruct(v, 103) is None]
    bound = math.isqrt(51)
    small = {
        n * pow(d, -1, 103) % 103 for n in range(-bound, bound + 1) for d in range(1, bound + 1)
    }
    assert missing == sorted(set(range(103)) - small)
    assert missing


# Exact geometry.


def product(a, b):
    """Return a . b as a map from radicand to coefficient, exactly."""
    total = {}
    for x, y in zip(a, b, strict=True):
        root = Surd.root(Fraction(x.s * y.s), 1.0)
        total[root.s] = total.get(root.s, Fraction(0)) + x.q * y.q * root.q
    return {s: q for s, q in total.items() if q}


def directions(robot, exact):
    """Return pairs of a unit vector in floats, in the exact frame, and in exact numbers."""
    return [
        (exact.frame @ q.value, own.values[q.name])
        for leg, own in zip(robot.legs, exact.legs, strict=True)
        for q in leg.quantities
        if q.role == "direction"
    ]


def check_exactness(robot, exact):
    pairs = directions(robot, exact)
    for given_vector, own in pairs:
        assert product(own, own) == {1: 1}, "unit length, exactly"
        np.testing.assert_allclose([float(v) for v in own], given_vector, rtol=0, atol=1e-8)
    np.testing.assert_allclose(exact.frame @ exact.frame.T, np.eye(3), rtol=0, atol=1e-14)
    lost = 0
    for i, (a, exact_a) in enumerate(pairs):
        for b, exact_b in pairs[:i]:
            if np.linalg.norm(np.cross(a, b)) < 1e-12:
                sense = Fraction(round(float(a @ b)))
                assert exact_a == tuple(v.times(sense) for v in exact_b), "parallel, exactly"
            if abs(a @ b) < 1e-12:
                lost += product(exact_a, exact_b) != {}
    assert lost == 0 or exact.lost
    gravity = [float(g) for g in exact.gravity]
    np.testing.assert_allclose(gravity, exact.frame @ robot.gravity, rtol=0, atol=1e-5)
    for leg, own in zip(robot.legs, exact.legs, strict=True):
        assert float(own.lengths["lu"]) == pytest.approx(leg.upper_length, rel=1e-11)
        assert float(own.lengths["ll"]) == pytest.approx(leg.lower_length, rel=1e-11)
        assert own.values["elbow"] == (Surd(Fraction(leg.elbow)),)


@pytest.mark.parametrize("name", MECHANISMS)
def test_exact_geometry_keeps_unit_length_right_angles_and_parallels(name):
    check_exactness(MECHANISMS[name], exact_geometry(MECHANISMS[name]))


@settings(deadline=None, derandomize=True, max_examples=25)
@given(st.sampled_from(["quadrupteron", "tripteron"]), st.integers(0, 2**32 - 1))
def test_a_turned_machine_keeps_its_exact_numbers(name, seed):
    robot = CATALOG[name]
    turned = pteron.turned(robot, Rotation.random(rng=seed).as_matrix())
    exact, moved = exact_geometry(robot), exact_geometry(turned)
    check_exactness(turned, moved)
    assert moved.lost == ()
    assert moved.radicands == frozenset()
    # Which axis is called x may change, as long as all vectors change together: products stay.
    for (_, a), (_, b) in zip(directions(robot, exact), directions(turned, moved), strict=True):
        for (_, c), (_, d) in zip(directions(robot, exact), directions(turned, moved), strict=True):
            assert product(a, c) == product(b, d)
    for own, other in zip(exact.legs, moved.legs, strict=True):
        assert product(own.direction, exact.gravity) == product(other.direction, moved.gravity)
        s0, moved_s0 = own.platform_point, other.platform_point
        assert (own.lengths, s0[2]) == (other.lengths, moved_s0[2])
        assert product(s0, s0) == product(moved_s0, moved_s0)


@settings(deadline=None, derandomize=True, max_examples=15)
@given(st.integers(0, 10**6), st.sampled_from(["PPPP", "PPP", "RRR", "RPR"]))
def test_random_machines_are_approximated_with_unit_length(seed, kinds):
    robot = random_machine(seed, kinds)
    check_exactness(robot, exact_geometry(robot))


def test_roots_are_recognised():
    robot = CATALOG["quadrupteron"]
    legs = list(robot.legs)
    half, height = 0.5, math.sqrt(0.75)
    legs[2] = replace(legs[2], direction=(height, half, 0.0))
    exact = exact_geometry(replace(robot, legs=tuple(legs)))
    assert exact.radicands == {3}
    assert any("sqrt(3)" in line and line.startswith("d3.") for line in exact.recognised)
    check_exactness(replace(robot, legs=tuple(legs)), exact)


def test_the_catalogs_geometry_is_its_decimals():
    exact = exact_geometry(CATALOG["quadrupteron"])
    assert exact.recognised == exact.approximated == exact.lost == ()
    first = exact.legs[0]
    assert [str(v) for v in first.lengths.values()] == ["203/1000", "223/1000"]
    assert exact.gravity[2] == Surd(Fraction(-981, 100))


@pytest.mark.parametrize("name", ["quadrupteron-oblique", "random 3T1R 0", "delta"])
def test_a_unit_vector_across_d_in_a_field(name):
    exact = exact_geometry(MECHANISMS[name])
    factors = {f for s in exact.radicands for f in sympy.factorint(s)}
    prime = next(
        p
        for p in sympy.primerange(10**9, 10**9 + 10**4)
        if p % 4 == 3 and all(is_square(f, p) for f in factors)
    )
    field = PrimeField(prime)
    for leg in exact.legs:
        values = leg.field_elements(field)
        a, d = values["plane_axis"], values["direction"]
        assert sum(x * x for x in a) % prime == 1
        assert sum(x * y for x, y in zip(a, d, strict=True)) % prime == 0


KINDS = {leg.type: leg for kinds in ("PRSU", "CL") for leg in random_machine(0, kinds).legs}


@pytest.mark.parametrize("kind", KINDS)
def test_a_leg_closes_without_a_root(kind):
    """In fractions: its discriminant is a square, and the elbow on the side that is said."""
    x, y, z = (tuple(Fraction(int(i == k)) for i in range(3)) for k in range(3))
    for seed in range(10):
        rng = random.Random(seed)
        e = x if kind == "PRR" else (Fraction(3, 5), Fraction(0), Fraction(4, 5))
        directions = {"direction": z, "slider_direction": e, "plane_axis": x, "zero_direction": y}
        lengths = {"upper_length": (Fraction(2, 7),), "lower_length": (Fraction(3, 5),)}
        w, sigma = type(KINDS[kind]).draw_closure(directions | lengths, rng)
        assert all(isinstance(value, Fraction) for value in w)
        fields = {key: [float(v) for v in value] for key, value in directions.items()}
        fields |= {"upper_length": 2 / 7, "lower_length": 0.6, "guide_point": (0.0, 0.0, 0.0)}
        own = {key: value for key, value in fields.items() if hasattr(KINDS[kind], key)}
        leg = replace(KINDS[kind], **own, elbow=sigma)
        reach = leg.equations().reach([float(v) for v in w])
        assert float(reach.discriminant) >= 0
        # The root of what stands under the radical is rational.
        exact = {
            key: ca.SX.sym(key, len(value))
            for key, value in ((q.name, q.value) for q in leg.quantities)
        }
        c = ca.SX.sym("c", 3)
        root = ca.sqrt(type(leg.equations())(**exact).reach(c).discriminant)
        function = ca.Function("root", [*exact.values(), c], [root])
        values = {
            q.name: [Fraction(v).limit_denominator(10**6) for v in q.value] for q in leg.quantities
        }
        ((found,),) = evaluate(function, RationalField(), [*values.values(), w])
        assert found**2 == pytest.approx(float(reach.discriminant))
