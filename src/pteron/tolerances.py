"""The five differences below which two numbers count as one, smallest first.

They are relative to the size of what is compared, or in m and rad: machines have sizes about one
metre. A constant of another value stands where it is used, with its reason.
"""

from __future__ import annotations

LAST_DIGITS = 1e-13
"""Rounding of a few operations: doubles have 16 digits, a sum of hundreds of terms loses two."""

EXACT = 1e-12
"""Rounding of a closed form: thousands of operations, and divisions by numbers of some percent."""

ROUNDING = 1e-9
"""Rounding after iterations or a linear system: a condition of 1e3 takes three digits more. The
files that Pteron writes have all digits, so that nothing else is lost between two computations."""

ROOT_OF_ROUNDING = 1e-7
"""Error of what depends on the root of a rounded number, as where a leg is stretched: the root of
`LAST_DIGITS` and less."""

SAME = 1e-6
"""Difference of numbers that people or other programs have written: six digits are what they
write, and a micrometre is less than any machine is made to."""
