"""The indices of performance: what each one means, in which unit, and where it comes from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pteron.errors import DataError, ModelError
from pteron.manipulator import Manipulator, RobotLike, as_manipulator


@dataclass(frozen=True)
class Index:
    """One index of performance.

    Attributes
    ----------
    name : str
        As `evaluate` takes it.
    title : str
        As a picture's colour bar says it, without the unit.
    formula : str
        In LaTeX, in the letters of the documentation's page on indices.
    source : str
        Who defined it.
    unit : str
        Empty for a plain number.
    better : {"more", "less"}
        The values that are good.
    turning : bool
        Whether it is about the platform's turning, so that a machine must have an angle.
    moving : bool
        Whether it is about its translation, so that the pose must have lengths.
    """

    name: str
    title: str
    formula: str
    source: str
    unit: str
    better: Literal["more", "less"]
    turning: bool = False
    moving: bool = True

    @property
    def label(self) -> str:
        """The title and, in brackets, the unit."""
        return f"{self.title} ({self.unit})" if self.unit else self.title


_YOSHIKAWA = "T. Yoshikawa, The International Journal of Robotics Research 4(2) (1985) 3-9"
_MERLET = "J.-P. Merlet, Journal of Mechanical Design 128 (2006) 199-206"

_LISTED = (
    Index(
        "condition",
        "condition of the Jacobian",
        r"\kappa(\bar J) = \sigma_{\max}(\bar J) / \sigma_{\min}(\bar J)",
        "J. K. Salisbury, J. J. Craig, The International Journal of Robotics Research 1(1) (1982) "
        "4-17; J. Angeles, the same 11(3) (1992) 196-201 (characteristic length)",
        "",
        "less",
        moving=False,
    ),
    Index(
        "condition_points",
        "condition of the Jacobian by points",
        r"\kappa(J R^{-1}), \quad R^T R = \tfrac{1}{n} \textstyle\sum_i C_i^T C_i",
        "G. Pond, J. A. Carretero, Mechanism and Machine Theory 41 (2006) 1505-1519; S.-G. Kim, "
        "J. Ryu, IEEE Transactions on Robotics and Automation 19 (2003) 731-736",
        "",
        "less",
        moving=False,
    ),
    Index(
        "manipulability",
        "manipulability",
        r"w = |\det \bar J|^{-1}",
        _YOSHIKAWA,
        "",
        "more",
        moving=False,
    ),
    Index(
        "speed_least",
        "least speed of the platform",
        r"1 / \sigma_{\max}(\bar J_t)",
        _YOSHIKAWA,
        "m/s per m/s",
        "more",
    ),
    Index(
        "speed_most",
        "greatest speed of the platform",
        r"1 / \sigma_{\min}(\bar J_t)",
        _YOSHIKAWA,
        "m/s per m/s",
        "more",
    ),
    Index(
        "turning_speed",
        "turning speed of the platform",
        r"1 / |\bar J_\varphi L|",
        _YOSHIKAWA,
        "rad/s per m/s",
        "more",
        turning=True,
        moving=False,
    ),
    Index(
        "force_least",
        "least force on the platform",
        r"1 / \sigma_{\max}(\bar G_t)",
        _YOSHIKAWA,
        "N per N",
        "more",
    ),
    Index(
        "force_most",
        "greatest force on the platform",
        r"1 / \sigma_{\min}(\bar G_t)",
        _YOSHIKAWA,
        "N per N",
        "more",
    ),
    Index(
        "turning_moment",
        "moment on the platform",
        r"L / |\bar G_\varphi|",
        _YOSHIKAWA,
        "N m per N",
        "more",
        turning=True,
        moving=False,
    ),
    Index(
        "pressure_angle",
        "pressure angle at the joints",
        r"\max_i \angle(\partial q_i / \partial c_i, g_i)",
        "J. Wang, C. Wu, X.-J. Liu, Mechanism and Machine Theory 45 (2010) 1462-1476: the input "
        "transmission index is its cosine",
        "rad",
        "less",
        moving=False,
    ),
    Index(
        "output_pressure_angle",
        "pressure angle at the platform",
        r"\max_i \angle(\partial q_i / \partial c_i, C_i G e_i)",
        "the same: the output transmission index is its cosine",
        "rad",
        "less",
        moving=False,
    ),
    Index(
        "error",
        "position error of joint errors",
        r"\|\bar G_t\|_F",
        _MERLET,
        "m per m",
        "less",
    ),
    Index(
        "error_worst",
        "worst position error of joint errors",
        r"\max_{s \in \{-1, 1\}^n} |\bar G_t s|",
        _MERLET,
        "m per m",
        "less",
    ),
    Index(
        "turning_error",
        "angle error of joint errors",
        r"|\bar G_\varphi| / L",
        _MERLET,
        "rad per m",
        "less",
        turning=True,
        moving=False,
    ),
    Index(
        "turning_error_worst",
        "worst angle error of joint errors",
        r"\|\bar G_\varphi\|_1 / L",
        _MERLET,
        "rad per m",
        "less",
        turning=True,
        moving=False,
    ),
    Index(
        "kappa",
        "condition of the mass matrix",
        r"\kappa(\bar M) = \lambda_{\max}(\bar M) / \lambda_{\min}(\bar M)",
        "H. Asada, Journal of Dynamic Systems, Measurement, and Control 105 (1983) 131-142 "
        "(generalized inertia ellipsoid)",
        "",
        "less",
        moving=False,
    ),
)

INDICES: dict[str, Index] = {index.name: index for index in _LISTED}
"""The indices by name."""


def indices_of(robot: RobotLike) -> tuple[str, ...]:
    """Return the names of the indices that a machine has: those of what its platform does.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.

    Returns
    -------
    tuple of str

    Examples
    --------
    >>> from pteron.indices import indices_of
    >>> "turning_speed" in indices_of("tripteron"), "turning_speed" in indices_of("quadrupteron")
    (False, True)
    """
    robot = as_manipulator(robot)
    return tuple(i.name for i in _LISTED if not _lacking(robot, i))


def _lacking(robot: Manipulator, index: Index) -> str:
    """Return what of an index a platform does not do; nothing where it has the index."""
    if index.turning and not robot.platform.angles:
        return "turning, but this {} platform does not turn"
    if index.moving and not robot.platform.lengths:
        return "translation, but this {} platform only turns"
    return ""


def expect_index(robot: RobotLike, name: str) -> Index:
    """Return the index of a name that a machine has, or say which ones it has."""
    robot = as_manipulator(robot)
    if name not in INDICES:
        raise DataError(f"index: {name!r} is not known; choose from {', '.join(INDICES)}")
    index = INDICES[name]
    if lacking := _lacking(robot, index):
        raise ModelError(
            f"index: {name!r} is about {lacking.format(robot.platform.motion)}; choose from "
            f"{', '.join(indices_of(robot))}",
            subject=robot.name,
        )
    return index
