"""Method `exact` of `base_parameters`: a regressor's null space by exact arithmetic, certified.

Null vectors are found modulo primes of 61 bits, lifted to fractions, and verified in fractions. So
the rank is bounded from below by a minor that does not vanish, and from above by null vectors that
annihilate the regressor.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from fractions import Fraction
from functools import reduce
from operator import add
from typing import TypeVar

import numpy as np
from sympy import Integer, factorint, isprime

from pteron.bodies.parameters import Parameter
from pteron.errors import ModelError, SingularPose
from pteron.kernels import Array, PrimeField, bare
from pteron.kinematics import is_singular_everywhere
from pteron.kinematics.jacobian_keys import alternatives, jacobian_keys
from pteron.manipulator import Manipulator
from pteron.reduction.certificate import ExactCertificate
from pteron.reduction.elimination import dependencies, reconstruct, remainder
from pteron.reduction.exact_geometry import ExactGeometry, exact_geometry
from pteron.reduction.exact_regressor import (
    degree_bound,
    is_square,
    modular_rows,
    rational_rows,
    roots,
)
from pteron.reduction.grouping import Grouping, Shares
from pteron.reduction.numerical import fitted_shares, numerical_rank
from pteron.reduction.symbols import algebraic_values, symbolic_shares
from pteron.reduction.transfers import Transfer

_BITS = 61
"""Bits of a prime."""

_MOST_PRIMES = 8
"""Primes whose residues are combined to fractions before that is given up."""

_FEW_PRIMES = 3
"""The same with roots in the geometry, where shares are hardly ever fractions, and where mass
transfers, which give the shares, explain them all."""

_SPARE_STATES = 4
"""Random states beyond those whose rows are as many as the columns."""

_RATIONAL_CHECKS = 2
"""States at which the result is verified in fractions."""

_MODULAR_CHECKS = 2
"""States at which the result is verified modulo a prime that it was not found with."""


Number = TypeVar("Number", int, Fraction)
Relations = dict[int, dict[int, int]]


def exact_grouping(
    robot: Manipulator,
    columns: Sequence[Parameter],
    order: Sequence[int],
    sharing: Array,
    mass_transfers: Sequence[Transfer],
    seed: int,
) -> Grouping:
    """Return the grouping of a machine's columns, kept in the order of preference.

    Raises
    ------
    SingularPose
        If every pose is singular, so that there is no regressor.
    """
    if is_singular_everywhere(robot):
        raise _without_dynamics(robot)
    geometry = exact_geometry(robot)
    topology, n, exact_values = bare(robot), robot.freedom, algebraic_values(geometry)
    rng = random.Random(seed)
    primes = primes_of(geometry, rng)
    states = -(-len(order) // n) + _SPARE_STATES

    found: dict[int, tuple[list[int], Relations]] = {}
    shares: dict[int, dict[int, Fraction]] | None = None
    most = _FEW_PRIMES
    while len(found) < most and shares is None:
        prime = next(primes)
        try:
            rows = _shared_rows(modular_rows(topology, geometry, prime, states, rng), sharing)
        except ZeroDivisionError:
            raise _without_dynamics(robot) from None
        found[prime] = dependencies(rows, order, prime)
        # A prime may hide a column by bad luck, never invent one: keep those of greatest rank.
        best = max(len(kept) for kept, _ in found.values())
        found = {p: result for p, result in found.items() if len(result[0]) == best}
        if len(found) > 1:
            shares = _lifted(found)
        first, (kept, relations) = next(iter(found.items()))
        dropped = [column for column in order if column not in kept]
        by_mass = [_modular(transfer, geometry, columns, first) for transfer in mass_transfers]
        extra = _unexplained(by_mass, relations, dropped, len(order), first)
        most = _MOST_PRIMES if extra and not geometry.radicands else _FEW_PRIMES

    if shares is None and not extra and not geometry.radicands:
        # Fractions of more digits than the primes hold.
        known = symbolic_shares(columns, sorted(kept), mass_transfers, [], exact_values)
        shares = {
            column: {k: Fraction(int(share.p), int(share.q)) for k, share in terms.items()}
            for column, terms in known.items()
        }

    fresh = next(primes)
    rational_checks = 0
    coefficients = "rational"
    given: Shares
    if shares is not None:
        given = {column: dict(terms) for column, terms in shares.items()}
        field = PrimeField(fresh)
        residues = {
            column: {k: field.number(share) for k, share in terms.items()}
            for column, terms in shares.items()
        }
        if not geometry.radicands:
            exact_rows = rational_rows(topology, geometry, _RATIONAL_CHECKS, rng)
            hold = _annihilate(shares, _shared_rows(exact_rows, sharing), None)
            # Only what is due to special guide points may fail at others.
            assert hold or extra
            rational_checks = hold * len(exact_rows) // n
    else:
        new_rows = modular_rows(topology, geometry, fresh, states, rng)
        residues = dependencies(_shared_rows(new_rows, sharing), order, fresh)[1]
        if extra:
            coefficients = "floating point"
            given = fitted_shares(robot, sharing, kept, dropped, seed)
        else:
            coefficients = "algebraic"
            given = symbolic_shares(columns, sorted(kept), mass_transfers, [], exact_values)
    rows = _shared_rows(modular_rows(topology, geometry, fresh, _MODULAR_CHECKS, rng), sharing)
    vectors = [{-1: _modular(transfer, geometry, columns, fresh)} for transfer in mass_transfers]
    assert all(_annihilate(each, rows, fresh) for each in (residues, *vectors))

    degree = degree_bound(topology)
    # A pose is drawn among the 1 in 2^n whose n radicands are squares, and the 2^n choices of their
    # roots multiply the degree.
    odds = min(1.0, degree * 4.0 ** roots(topology) / fresh) ** _MODULAR_CHECKS
    numerical = None
    if geometry.approximated or geometry.recognised or geometry.nearly:
        with suppress(ModelError):  # no states are found
            numerical = numerical_rank(robot, sharing, seed)
    certificate = ExactCertificate(
        method="exact",
        rank=len(kept),
        columns=len(order),
        primes=tuple(found),
        states=states,
        null_vectors=len(dropped),
        rational_configurations=rational_checks,
        modular_configurations=_MODULAR_CHECKS,
        degree=degree,
        false_acceptance=len(dropped) * odds,
        transfers=len(mass_transfers),
        unexplained=tuple(columns[column].name for column in extra),
        coefficients=coefficients,
        recognised=geometry.recognised,
        approximated=geometry.approximated,
        lost=geometry.lost,
        nearly=geometry.nearly,
        numerical=numerical,
    )
    return Grouping(tuple(sorted(kept)), given, certificate)


def _without_dynamics(robot: Manipulator) -> SingularPose:
    return SingularPose(
        "singular at every pose (type II), so that it has no inverse dynamics and no base "
        "parameters; change what the Jacobian depends on, a leg's "
        f"{alternatives(jacobian_keys(robot))}",
        kind="II",
        measure=0.0,
        index=(),
        subject=robot.name,
    )


def _modular(
    transfer: Transfer, geometry: ExactGeometry, columns: Sequence[Parameter], prime: int
) -> dict[int, int]:
    """Return a transfer's null vector modulo a prime, by column."""
    field = PrimeField(prime)
    symbols = {name: Integer(value.within(field)) for name, value in geometry.symbols().items()}
    entries = {columns.index(c): int(v) % prime for c, v in transfer.evaluate(symbols).items()}
    return {column: value for column, value in entries.items() if value}


def _unexplained(
    by_mass: Sequence[dict[int, int]],
    relations: Relations,
    dropped: Sequence[int],
    columns: int,
    prime: int,
) -> list[int]:
    """Return the dropped columns whose relations do not follow from the mass transfers."""
    vectors = [*by_mass]
    for column in dropped:
        shares = {k: -share % prime for k, share in relations[column].items()}
        vectors.append({**shares, column: 1})
    rows = [[vector.get(j, 0) for vector in vectors] for j in range(columns)]
    kept, _ = dependencies(rows, range(len(vectors)), prime)
    return [dropped[i - len(by_mass)] for i in kept if i >= len(by_mass)]


def primes_of(geometry: ExactGeometry, rng: random.Random) -> Iterator[int]:
    """Yield primes p = 3 (mod 4) in which the geometry's roots exist."""
    factors = {prime for s in geometry.radicands for prime in factorint(s)}
    while True:
        candidate = rng.getrandbits(_BITS) | (1 << (_BITS - 1)) | 3
        if isprime(candidate) and all(is_square(f % candidate, candidate) for f in factors):
            yield candidate


def _shared_rows(rows: Sequence[Sequence[Number]], sharing: Array) -> list[list[Number]]:
    """Return the rows with the columns of legs that share parameters added up."""
    members = [np.flatnonzero(column).tolist() for column in sharing.T]
    return [[reduce(add, (row[j] for j in group)) for group in members] for row in rows]


def _lifted(
    found: dict[int, tuple[list[int], Relations]],
) -> dict[int, dict[int, Fraction]] | None:
    """Return the shares as fractions, if all primes but the last give what the last confirms."""
    primes = list(found)
    *earlier, last = primes
    lifted: dict[int, dict[int, Fraction]] = {}
    field = PrimeField(last)
    for column in found[last][1]:
        terms = {k for prime in primes for k in found[prime][1][column]}
        lifted[column] = {}
        for k in sorted(terms):
            residues = [found[prime][1][column].get(k, 0) for prime in earlier]
            share = reconstruct(*remainder(residues, earlier))
            if share is None or share.denominator % last == 0:
                return None
            if field.number(share) != found[last][1][column].get(k, 0):
                return None
            if share:
                lifted[column][k] = share
    return lifted


def _annihilate(
    relations: Mapping[int, Mapping[int, Fraction]] | Mapping[int, Mapping[int, int]],
    rows: Sequence[Sequence[int]] | Sequence[Sequence[Fraction]],
    prime: int | None,
) -> bool:
    """Say whether every null vector annihilates the rows.

    A relation gives a column as shares of the kept columns; under the key -1 stands a null vector
    itself.
    """
    for row in rows:
        for column, terms in relations.items():
            whole = row[column] if column >= 0 else 0
            misfit = whole - sum(share * row[k] for k, share in terms.items())
            if (misfit if prime is None else misfit % prime) != 0:
                return False
    return True
