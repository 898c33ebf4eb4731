"""Gaussian elimination modulo a prime for a matrix's dependent columns; fractions from residues."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import isqrt


def dependencies(
    rows: Sequence[Sequence[int]], order: Sequence[int], prime: int
) -> tuple[list[int], dict[int, dict[int, int]]]:
    """Return the independent columns of a matrix modulo a prime, and the others' shares.

    Parameters
    ----------
    rows : sequence of rows
        The matrix.
    order : sequence of int
        The columns in order of preference: one is kept if those kept before do not give it.
    prime : int
        The modulus.

    Returns
    -------
    kept : list of int
        In the order of preference.
    given : dict
        For each other column, its coefficients on the kept columns.
    """
    work = [[row[j] % prime for j in order] for row in rows]
    independent: list[int] = []
    for place, column in enumerate(order):
        top = len(independent)
        pivot = next((i for i in range(top, len(work)) if work[i][place]), None)
        if pivot is None:
            continue
        work[top], work[pivot] = work[pivot], work[top]
        inverse = pow(work[top][place], -1, prime)
        lead = work[top] = [number * inverse % prime for number in work[top]]
        for i, row in enumerate(work):
            factor = row[place]
            if i != top and factor:
                work[i] = [(a - factor * b) % prime for a, b in zip(row, lead, strict=True)]
        independent.append(column)
    relations = {
        column: {k: work[i][place] for i, k in enumerate(independent) if work[i][place]}
        for place, column in enumerate(order)
        if column not in independent
    }
    return independent, relations


def remainder(residues: Sequence[int], primes: Sequence[int]) -> tuple[int, int]:
    """Return the number modulo the product of the primes (Chinese remainders), and that product."""
    total, modulus = 0, 1
    for residue, prime in zip(residues, primes, strict=True):
        step = (residue - total) * pow(modulus, -1, prime) % prime
        total, modulus = total + modulus * step, modulus * prime
    return total, modulus


def reconstruct(residue: int, modulus: int) -> Fraction | None:
    """Return the fraction a / b = residue (mod modulus), a and b below sqrt(modulus / 2), or None.

    There is at most one. Wang's algorithm: Euclid's, stopped half way.
    """
    bound = isqrt(modulus // 2)
    a, b = modulus, residue % modulus
    u, v = 0, 1
    while b > bound:
        quotient = a // b
        a, b = b, a - quotient * b
        u, v = v, u - quotient * v
    if v == 0 or abs(v) > bound:
        return None
    return Fraction(b, v)
