"""`stiffness`: compliance at the tool and natural frequencies, from elastic actuators and links."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pteron.dynamics import mass_matrix
from pteron.errors import DataError, ModelError
from pteron.indices.elasticity import Elasticity
from pteron.indices.internal_forces import (
    Equations,
    balance_loads,
    blocks,
)
from pteron.indices.sensitivities import tool_arm
from pteron.indices.strains import (
    FREE,
    energy_matrix,
    least_energy_forces,
    strains_of,
    unit_loads,
)
from pteron.kernels import Array, as_array
from pteron.kinematics import twist
from pteron.kinematics.evaluate import evaluate_kernel, finite_rows
from pteron.manipulator import Manipulator, RobotLike, as_manipulator
from pteron.renamed import former_attribute
from pteron.result import Result
from pteron.shapes import Matrices, Numbers, OnFailure, PerCoordinate, PoseLike


@dataclass(frozen=True, eq=False, repr=False)
class Stiffness(Result):
    """Compliance of a machine under a load at its tool, while the actuators hold their joints.

    Attributes
    ----------
    compliance : array, shape (..., m, m)
        C: change of the tool's pose per unit of a wrench on it: m/N, rad/N and rad/(N m). Of a
        platform that tilts (..., 6, 6): displacement and turn in base axes per force and moment.
    frequencies : array, shape (..., m)
        Natural frequencies of the bodies' masses, in platform coordinates, on these springs, Hz,
        ascending; infinite where nothing gives way.
    lengths : int
        Number of the rows of C, the first ones, that are lengths.
    """

    ROWS = "compliance:2 frequencies:1"

    compliance: Matrices
    frequencies: PerCoordinate
    lengths: int

    @property
    def matrix(self) -> Matrices:
        """Stiffness matrix at the tool, K, the inverse of the compliance, (..., m, m).

        Raises
        ------
        ModelError
            If the platform tilts and has fewer than six freedoms: its joints hold the others.
        """
        size, freedom = self.compliance.shape[-1], self.frequencies.shape[-1]
        if freedom < size:
            raise ModelError(
                f"matrix: a platform of {freedom} freedoms does not give way in {size - freedom} "
                "others, so that the compliance has no inverse; use compliance, least or "
                "directional_stiffness"
            )
        return np.linalg.inv(self.compliance)

    @property
    def least(self) -> Numbers:
        """Force over the tool's displacement in the worst direction, N/m, without a moment."""
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / self._principal_compliances[..., -1])

    @property
    def greatest(self) -> Numbers:
        """Force over the tool's displacement in the best direction, N/m, without a moment."""
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / np.maximum(self._principal_compliances[..., 0], 0.0))

    @property
    def _principal_compliances(self) -> Array:
        """Eigenvalues (..., k) of the tool's compliance, force to displacement, ascending, m/N."""
        k = self.lengths
        part = self.compliance[..., :k, :k]
        known = np.isfinite(part).all(axis=(-2, -1))
        eigenvalues = np.linalg.eigvalsh(np.where(known[..., None, None], part, 0.0))
        return np.asarray(np.where(known[..., None], eigenvalues, np.nan))

    def directional_stiffness(self, direction: ArrayLike) -> Numbers:
        """Return the stiffness (...), N/m: force over the tool's displacement along `direction`.

        Raises
        ------
        DataError
            If it has not as many numbers as C has lengths, or no length.
        """
        u = as_array(direction, "direction", (self.lengths,))
        size = np.linalg.norm(u, axis=-1, keepdims=True)
        if not (size > 0.0).all():
            raise DataError("direction: a zero vector given, one with a direction expected")
        u = u / size
        k = self.lengths
        with np.errstate(divide="ignore"):
            return np.asarray(
                1.0 / np.einsum("...i,...ij,...j", u, self.compliance[..., :k, :k], u)
            )

    most = former_attribute("most", "greatest")
    along = former_attribute("along", "directional_stiffness")


def stiffness(
    robot: RobotLike, pose: PoseLike, elasticity: Elasticity, *, on_failure: OnFailure = "raise"
) -> Stiffness:
    """Return the stiffness at the tool, due to elastic actuators and links.

    By Castigliano's theorem C = X^T W X, where W is the energy matrix of the internal forces w, and
    X are the internal forces of unit loads. Actuators are springs at their joints (C. Gosselin,
    IEEE Transactions on Robotics and Automation 6 (1990) 377-382: K = J^T K_q J if nothing else is
    elastic); links are slender beams with tension, bending and torsion; rods have tension only and,
    if their distance is given, the couple of a pair (the virtual joints of A. Pashkevich, D.
    Chablat and P. Wenger, Mechanism and Machine Theory 44 (2009) 966-982, integrated along a link).
    In an overconstrained machine the self-stress minimises the energy. Joints, guides and the
    platform are rigid; preloads are neglected, and so are loads that the legs of a platform free to
    tilt cannot bear.

    Parameters
    ----------
    robot : Manipulator, name or path
        The machine.
    pose : array, shape (..., m)
        The poses, m and rad.
    elasticity : Elasticity
        The stiffnesses.
    on_failure : {"raise", "nan"}
        Whether a pose that fails raises, or gives NaN.

    Returns
    -------
    Stiffness

    Raises
    ------
    ModelError
        If the elasticity is of another number of legs.
    UnreachablePose
        If a leg does not reach a pose.
    SingularPose
        If a leg is stretched or folded (type I), or the actuators do not hold the platform
        (type II).

    Examples
    --------
    >>> from pteron.indices import ALUMINIUM, Elasticity, Section, stiffness
    >>> tube = Section.square_tube(0.06, 0.004, ALUMINIUM)
    >>> found = stiffness("tripteron", [0.0, 0.0, 0.0], Elasticity(1e6, upper=tube, lower=tube))
    >>> found.compliance.shape, bool(found.least < 1e6)
    ((3, 3), True)
    """
    robot = as_manipulator(robot)
    poses = finite_rows(robot, pose, "pose", on_failure)
    # Errors name a state of the whole batch.
    evaluate_kernel(robot, "manipulability", on_failure, poses)
    parts = [
        _block_compliance(robot, elasticity, block)
        for (block,) in blocks([poses.reshape(-1, robot.freedom)])
    ]
    compliance, frequencies = (
        np.concatenate(part).reshape((*poses.shape[:-1], *part[0].shape[1:]))
        for part in zip(*parts, strict=True)
    )
    lengths = sum(name.startswith("f") for name in robot.platform.wrench_columns)
    return Stiffness(compliance, frequencies, lengths)


def _block_compliance(
    robot: Manipulator, elasticity: Elasticity, poses: Array
) -> tuple[Array, Array]:
    """Return the compliance at the tool (B, m, m) and the natural frequencies (B, m), Hz."""
    batch, m = poses.shape
    zero_rates = np.zeros(m)
    outputs: tuple[Array, ...] = evaluate_kernel(
        robot, "reactions", "nan", poses, zero_rates, zero_rates
    )
    link_lines: tuple[Array, ...] = evaluate_kernel(robot, "beams", "nan", poses)
    size = len(robot.platform.wrench_columns)
    compliance, frequencies = np.full((batch, size, size), np.nan), np.full((batch, m), np.nan)
    solvable = np.asarray(np.isfinite(outputs[0]).all(axis=(-2, -1)))
    if solvable.any():
        balance = Equations(*(array[solvable] for array in outputs))
        beams = [array[solvable] for array in link_lines]
        energy = energy_matrix(strains_of(elasticity, robot, balance, beams))
        point_compliance = _compliance(robot, balance, energy, np.zeros((len(energy), 3)))
        compliance[solvable] = point_compliance
        frequencies[solvable] = natural_frequencies(robot, poses[solvable], point_compliance)
        if any(robot.platform.tool):
            arm = tool_arm(robot, poses[solvable])
            compliance[solvable] = _compliance(robot, balance, energy, arm)
    return compliance, frequencies


def _compliance(robot: Manipulator, balance: Equations, energy: Array, arm: Array) -> Array:
    """Return the compliance C (B, m, m), or (B, 6, 6), at a point `arm` (B, 3), m, away from P."""
    load, applied = unit_loads(robot, balance, arm)
    batch, _, count = load.shape
    right = np.zeros((batch, balance.rows.shape[-2], count))
    presumed = np.zeros((batch, balance.presumed_rows.shape[-2], count))
    right[:, : robot.freedom] = -applied
    if presumed.size:  # else a joint holds what the legs do not
        presumed[:, :6] = -load
    balanced = balance_loads(robot, balance, right, presumed)
    forces = least_energy_forces(robot, balanced, energy)
    compliance = forces.mT @ energy @ forces
    return np.asarray(0.5 * (compliance + compliance.mT))


def _constrained_compliance(compliance: Array, twists: Array, length: float) -> Array:
    """Return the compliance (m, m) along a pose's coordinates, other motions constrained.

    The platform moves only by twists T x', T being `twists` (6, m), so that its stiffness is T^T
    C^-1 T. A direction in which the machine is rigid (C is singular) allows no x' that moves along
    it; `length` makes moments and forces comparable in deciding which directions are rigid.
    """
    scale = np.array([1.0, 1.0, 1.0, length, length, length])
    compliances, axes = np.linalg.eigh(scale[:, None] * compliance * scale)
    scaled = axes.T @ (scale[:, None] * twists)
    soft = compliances > FREE * compliances[-1]
    sizes, rows = np.linalg.svd(scaled[~soft], full_matrices=True)[1:]
    rank = int((sizes > np.sqrt(FREE) * np.linalg.norm(scaled)).sum())
    allowed = rows[rank:].T
    soft_motions = scaled[soft] @ allowed
    stiffness_of_free = soft_motions.T @ (soft_motions / compliances[soft, None])
    return np.asarray(allowed @ np.linalg.solve(stiffness_of_free, allowed.T))


def natural_frequencies(robot: Manipulator, poses: Array, compliance: Array) -> Array:
    """Return natural frequencies (B, m), Hz, at poses (B, m) with a compliance (B, c, c) at P."""
    if robot.platform.wrench_in_base_axes:
        twists = twist(robot, poses[:, None], np.eye(robot.freedom)).mT
        size_of_legs = float(np.mean([leg.size for leg in robot.legs]))
        compliance = np.stack(
            [
                _constrained_compliance(*state, size_of_legs)
                for state in zip(compliance, twists, strict=True)
            ]
        )
    lower = np.linalg.cholesky(mass_matrix(robot, poses))
    squares = np.linalg.eigvalsh(lower.mT @ compliance @ lower)[:, ::-1]
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / (2 * np.pi * np.sqrt(np.maximum(squares, 0.0))))
