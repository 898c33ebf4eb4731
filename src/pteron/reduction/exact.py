"""Method `exact` of `base_parameters`: a regressor's null space by exact arithmetic, certified.

Null vectors are found modulo primes of 61 bits, lifted to fractions, and verified in fractions. So
the rank is bounded from below by a minor that does not vanish, and from above by null vectors that
annihilate the regressor.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import reduce
from operator import add
from typing import Any, TypeVar

import numpy as np

from pteron.bodies.parameters import Parameter
from pteron.errors import ModelError, SingularPose
from pteron.kernels import Array, PrimeField, geometry_only
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
from pteron.reduction.primes import is_prime, prime_factors
from pteron.reduction.transfers import MassTransfer

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


@dataclass(frozen=True)
class _ExactRegressor:
    """A machine's regressor in exact numbers, the columns that legs share added up."""

    robot: Manipulator
    geometry: ExactGeometry
    columns: Sequence[Parameter]
    order: Sequence[int]
    sharing: Array
    transfers: Sequence[MassTransfer]
    rng: random.Random

    @property
    def states(self) -> int:
        """Number of random states at which the regressor has more rows than columns."""
        return -(-len(self.order) // self.robot.freedom) + _SPARE_STATES

    def rows(self, prime: int, states: int) -> list[list[int]]:
        """Return the rows at random states, modulo a prime."""
        rows = modular_rows(geometry_only(self.robot), self.geometry, prime, states, self.rng)
        return _shared_rows(rows, self.sharing)

    def rational_rows(self) -> list[list[Fraction]]:
        """Return the rows at random rational configurations; [] if a leg has none."""
        rows = rational_rows(geometry_only(self.robot), self.geometry, _RATIONAL_CHECKS, self.rng)
        return _shared_rows(rows, self.sharing)

    def mass_vectors(self, prime: int) -> list[dict[int, int]]:
        """Return the null vectors of the mass transfers modulo a prime, by column."""
        return [_modular(t, self.geometry, self.columns, prime) for t in self.transfers]

    def symbolic_shares(self, base_columns: Sequence[int]) -> dict[int, dict[int, Any]]:
        """Return the dependent columns' shares by the mass transfers, as exact SymPy numbers."""
        # SymPy is slow to import.
        from pteron.reduction.symbols import algebraic_values, symbolic_shares

        numbers = algebraic_values(self.geometry)
        return symbolic_shares(self.columns, sorted(base_columns), self.transfers, [], numbers)


@dataclass(frozen=True)
class _Elimination:
    """The independent columns modulo several primes, and the dependent columns' shares on them.

    Attributes
    ----------
    base_columns, dropped : list of int
        The independent columns and the others.
    extra : list of int
        Dropped columns that no mass transfer explains.
    primes : tuple of int
        Those that agree on the rank.
    shares : mapping, optional
        As fractions, where the primes give them.
    """

    base_columns: list[int]
    dropped: list[int]
    extra: list[int]
    primes: tuple[int, ...]
    shares: dict[int, dict[int, Fraction]] | None


@dataclass(frozen=True)
class _Verified:
    """Shares that annihilate the regressor at states that they were not computed from."""

    shares: Shares
    coefficients: str
    rational_configurations: int


def exact_grouping(
    robot: Manipulator,
    columns: Sequence[Parameter],
    order: Sequence[int],
    sharing: Array,
    mass_transfers: Sequence[MassTransfer],
    seed: int,
) -> Grouping:
    """Return the grouping of a machine's columns, kept in the order of preference.

    Raises
    ------
    SingularPose
        If every pose is singular, so that there is no regressor.
    """
    if is_singular_everywhere(robot):
        raise _no_dynamics_error(robot)
    geometry, rng = exact_geometry(robot), random.Random(seed)
    regressor = _ExactRegressor(robot, geometry, columns, order, sharing, mass_transfers, rng)
    primes = primes_of(geometry, rng)
    elimination = _eliminate(regressor, primes)
    fresh = next(primes)
    verified = _verify(regressor, elimination, fresh, seed)
    certificate = _certificate(regressor, elimination, verified, fresh, seed)
    return Grouping(tuple(sorted(elimination.base_columns)), verified.shares, certificate)


def _eliminate(regressor: _ExactRegressor, primes: Iterator[int]) -> _Elimination:
    """Return the elimination modulo as many primes as its shares need to become fractions."""
    geometry, order = regressor.geometry, regressor.order
    eliminations: dict[int, tuple[list[int], Relations]] = {}
    shares: dict[int, dict[int, Fraction]] | None = None
    most = _FEW_PRIMES
    while len(eliminations) < most and shares is None:
        prime = next(primes)
        try:
            rows = regressor.rows(prime, regressor.states)
        except ZeroDivisionError:
            raise _no_dynamics_error(regressor.robot) from None
        eliminations[prime] = dependencies(rows, order, prime)
        # A prime may hide a column by bad luck, never invent one: keep those of greatest rank.
        best = max(len(independent) for independent, _ in eliminations.values())
        eliminations = {p: pair for p, pair in eliminations.items() if len(pair[0]) == best}
        if len(eliminations) > 1:
            shares = _lift_to_fractions(eliminations)
        first, (base_columns, relations) = next(iter(eliminations.items()))
        dropped = [column for column in order if column not in base_columns]
        by_mass = regressor.mass_vectors(first)
        extra = _unexplained_columns(by_mass, relations, dropped, len(order), first)
        most = _MOST_PRIMES if extra and not geometry.radicands else _FEW_PRIMES
    if shares is None and not extra and not geometry.radicands:
        # Fractions of more digits than the primes hold.
        shares = {
            column: {k: Fraction(int(share.p), int(share.q)) for k, share in terms.items()}
            for column, terms in regressor.symbolic_shares(base_columns).items()
        }
    return _Elimination(base_columns, dropped, extra, tuple(eliminations), shares)


def _verify(
    regressor: _ExactRegressor, elimination: _Elimination, fresh: int, seed: int
) -> _Verified:
    """Return the shares after a check in fractions and modulo a fresh prime."""
    base_columns, shares = elimination.base_columns, elimination.shares
    rational_checks = 0
    verified: Shares
    if shares is not None:
        coefficients = "rational"
        verified = {column: dict(terms) for column, terms in shares.items()}
        field = PrimeField(fresh)
        residues = {
            column: {k: field.number(share) for k, share in terms.items()}
            for column, terms in shares.items()
        }
        if not regressor.geometry.radicands:
            rational = regressor.rational_rows()
            hold = _annihilate(shares, rational, None)
            # Only what is due to special guide points may fail at others.
            assert hold or elimination.extra
            rational_checks = hold * len(rational) // regressor.robot.freedom
    else:
        rows = regressor.rows(fresh, regressor.states)
        residues = dependencies(rows, regressor.order, fresh)[1]
        if elimination.extra:
            coefficients = "floating point"
            verified = fitted_shares(
                regressor.robot, regressor.sharing, base_columns, elimination.dropped, seed
            )
        else:
            coefficients = "algebraic"
            verified = regressor.symbolic_shares(base_columns)
    rows = regressor.rows(fresh, _MODULAR_CHECKS)
    vectors = [{-1: vector} for vector in regressor.mass_vectors(fresh)]
    assert all(_annihilate(each, rows, fresh) for each in (residues, *vectors))
    return _Verified(verified, coefficients, rational_checks)


def _certificate(
    regressor: _ExactRegressor,
    elimination: _Elimination,
    verified: _Verified,
    fresh: int,
    seed: int,
) -> ExactCertificate:
    """Return the certificate: the checks, and the probability that a false vector passes.

    `fresh` is the prime, none of the elimination's, modulo which the vectors are checked: the
    larger it is, the less likely a false vector passes.
    """
    robot, geometry = regressor.robot, regressor.geometry
    degree = degree_bound(geometry_only(robot))
    # A pose is drawn among the 1 in 2^n whose n radicands are squares, and the 2^n choices of their
    # roots multiply the degree.
    odds = min(1.0, degree * 4.0 ** roots(geometry_only(robot)) / fresh) ** _MODULAR_CHECKS
    numerical = None
    if geometry.approximated or geometry.recognised or geometry.nearly:
        with suppress(ModelError):  # no states are found
            numerical = numerical_rank(robot, regressor.sharing, seed)
    return ExactCertificate(
        method="exact",
        rank=len(elimination.base_columns),
        columns=len(regressor.order),
        primes=elimination.primes,
        states=regressor.states,
        null_vectors=len(elimination.dropped),
        rational_configurations=verified.rational_configurations,
        modular_configurations=_MODULAR_CHECKS,
        degree=degree,
        false_acceptance=len(elimination.dropped) * odds,
        transfers=len(regressor.transfers),
        unexplained=tuple(regressor.columns[column].name for column in elimination.extra),
        coefficients=verified.coefficients,
        recognised=geometry.recognised,
        approximated=geometry.approximated,
        lost=geometry.lost,
        nearly=geometry.nearly,
        numerical=numerical,
    )


def _no_dynamics_error(robot: Manipulator) -> SingularPose:
    """Return the error for a machine that is singular at every pose."""
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
    transfer: MassTransfer, geometry: ExactGeometry, columns: Sequence[Parameter], prime: int
) -> dict[int, int]:
    """Return a transfer's null vector modulo a prime: its nonzero entries by the column's index."""
    field = PrimeField(prime)
    symbols = {name: number.field_element(field) for name, number in geometry.symbols().items()}
    entries = {columns.index(c): v % prime for c, v in transfer.evaluate(symbols).items()}
    return {column: number for column, number in entries.items() if number}


def _unexplained_columns(
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
    independent, _ = dependencies(rows, range(len(vectors)), prime)
    return [dropped[i - len(by_mass)] for i in independent if i >= len(by_mass)]


def primes_of(geometry: ExactGeometry, rng: random.Random) -> Iterator[int]:
    """Yield primes p = 3 (mod 4) in which the geometry's roots exist."""
    factors = {prime for s in geometry.radicands for prime in prime_factors(s)}
    while True:
        candidate = rng.getrandbits(_BITS) | (1 << (_BITS - 1)) | 3
        if is_prime(candidate) and all(is_square(f % candidate, candidate) for f in factors):
            yield candidate


def _shared_rows(rows: Sequence[Sequence[Number]], sharing: Array) -> list[list[Number]]:
    """Return the rows with the columns of legs that share parameters added up."""
    members = [np.flatnonzero(column).tolist() for column in sharing.T]
    return [[reduce(add, (row[j] for j in group)) for group in members] for row in rows]


def _lift_to_fractions(
    eliminations: dict[int, tuple[list[int], Relations]],
) -> dict[int, dict[int, Fraction]] | None:
    """Return the shares as fractions from all primes but the last; None if that disagrees."""
    primes = list(eliminations)
    *earlier, last = primes
    lifted: dict[int, dict[int, Fraction]] = {}
    field = PrimeField(last)
    for column in eliminations[last][1]:
        terms = {k for prime in primes for k in eliminations[prime][1][column]}
        lifted[column] = {}
        for k in sorted(terms):
            residues = [eliminations[prime][1][column].get(k, 0) for prime in earlier]
            share = reconstruct(*remainder(residues, earlier))
            if share is None or share.denominator % last == 0:
                return None
            if field.number(share) != eliminations[last][1][column].get(k, 0):
                return None
            if share:
                lifted[column][k] = share
    return lifted


def _annihilate(
    relations: Mapping[int, Mapping[int, Fraction]] | Mapping[int, Mapping[int, int]],
    rows: Sequence[Sequence[int]] | Sequence[Sequence[Fraction]],
    prime: int | None,
) -> bool:
    """Return whether all relations between columns hold at all rows, modulo a prime if given.

    A relation gives a column as shares of the kept columns; under the key -1 stands a null vector
    itself.
    """
    for row in rows:
        for column, terms in relations.items():
            total = row[column] if column >= 0 else 0
            misfit = total - sum(share * row[k] for k, share in terms.items())
            if (misfit if prime is None else misfit % prime) != 0:
                return False
    return True
