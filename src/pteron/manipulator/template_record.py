"""`Template`: the machine of the catalog that a file was made from."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Template:
    """The machine that a file was made from, and the values of it that are meant.

    Parameters
    ----------
    kind : str
        The machine's name in the catalog.
    confirmed : tuple of str
        Keys of values that are to be as in it, such as "limits": nothing is said about them.
    """

    kind: str
    confirmed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "confirmed", tuple(self.confirmed))
