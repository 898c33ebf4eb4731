"""Quantities of a user: functions that a search improves or bounds, in other processes too."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from typing import Any

from pteron.design.quantities import DesignQuantity, quantities, quantity_of
from pteron.errors import DataError, shorten
from pteron.manipulator import Manipulator


def named_quantity(quantity: DesignQuantity | Callable[[Manipulator], float]) -> DesignQuantity:
    """Return a user's function of the machine as a `DesignQuantity` with the function's name.

    Raises
    ------
    DataError
        If it has no name, or that of a quantity of `quantities`.
    """
    quantity = quantity_of(quantity, getattr(quantity, "__name__", ""))
    if not quantity.name.isidentifier():
        raise DataError(
            f"name: {shorten(quantity.name)} given to a quantity, an identifier expected: give a "
            "function that has a name, or a DesignQuantity with name"
        )
    if quantity.name in quantities():
        raise DataError(f"{quantity.name}: is a quantity already; give yours another name")
    return quantity


def function_of(quantity: DesignQuantity) -> Any:
    """Return the function that computes a quantity."""
    return quantity.of_machine or quantity.of


def code_digest(quantity: DesignQuantity) -> str:
    """Return a digest of a user quantity's name, unit and code, to recognise stored results."""
    code = getattr(function_of(quantity), "__code__", None)
    parts = () if code is None else (code.co_code, code.co_consts, code.co_names)
    text = repr([quantity.name, quantity.unit, parts])
    # A function within it has its place in memory in its text.
    return hashlib.sha256(re.sub(r" at 0x\w+", "", text).encode()).hexdigest()[:16]
