"""Primes: the test of large numbers, and the factors of small ones."""

from __future__ import annotations

from functools import lru_cache

_BASES = 2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37
"""Miller and Rabin's test to these bases has no exception below 3.1e23 (J. Sorenson and J. Webster,
Strong pseudoprimes to twelve prime bases, Mathematics of Computation 86, 2017)."""


def is_prime(number: int) -> bool:
    """Return whether a number, of 64 bits at most, is a prime."""
    if number < 2 or any(number % base == 0 for base in _BASES):
        return number in _BASES
    odd, halvings = number - 1, 0
    while odd % 2 == 0:
        odd, halvings = odd // 2, halvings + 1
    for base in _BASES:
        power = pow(base, odd, number)
        squares = (pow(power, 2**k, number) for k in range(halvings))
        if power != 1 and number - 1 not in squares:
            return False
    return True


@lru_cache(maxsize=1024)
def prime_factors(number: int) -> tuple[int, ...]:
    """Return the prime factors of a positive number, ascending, each as often as it divides it."""
    factors, candidate = [], 2
    while candidate * candidate <= number:
        while number % candidate == 0:
            factors.append(candidate)
            number //= candidate
        candidate += 1
    return (*factors, number) if number > 1 else tuple(factors)
