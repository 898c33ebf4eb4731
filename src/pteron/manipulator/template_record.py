"""`Template`: the machine of the catalog that a file was made from."""

from __future__ import annotations

from dataclasses import dataclass

from pteron.errors import ModelError


@dataclass(frozen=True)
class Template:
    """The machine that a file was made from, and the values of it that are meant.

    Parameters
    ----------
    kind : str
        The machine's name in the catalog.
    confirmed : tuple of str
        Keys of values that are to be as in it, such as "limits": nothing is said about them.
    rider : tuple of float
        Mass, kg, and centre of mass, m, of what the platform's mass and inertia contain beside
        those that are compared with the template's; empty if there is nothing.
    """

    kind: str
    confirmed: tuple[str, ...] = ()
    rider: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "confirmed", tuple(self.confirmed))
        object.__setattr__(self, "rider", tuple(map(float, self.rider)))
        if len(self.rider) not in (0, 4):
            raise ModelError(
                f"rider: {list(self.rider)} given, a mass (kg) and x, y, z (m) of its centre "
                "expected",
                subject="template",
            )
