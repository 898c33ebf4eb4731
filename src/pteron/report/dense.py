"""Eq. (15) as a reader of the paper would evaluate it: dense matrices, one product after another.

This is the form whose time the paper's "41 % faster" speaks of. It is evaluated with NumPy on
batches, from the matrices J, Omega, J_u and J_l, which are computed beforehand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pteron.kernels import Array
from pteron.manipulator import parameters
from pteron.reduction import BaseParameters

__all__ = ["DenseModel", "PaperTerms"]

PaperTerms = tuple[Array, Array, Array, Array, Array]
"""J (b, m, m), Omega_p (b, n, n), link Jacobians (b, 2n, 6, m), link Omegas (b, 2n, 6, 4) and the
platform's Omega (b, m, 4), from the kernel `paper_terms`."""


@dataclass(frozen=True)
class DenseModel:
    """Eq. (15) for some of its columns.

    Attributes
    ----------
    sliders, platform : array of int
        Which columns of Omega_p and of the platform's Omega are kept.
    links : tuple of array of int
        Which columns of each link's Omega are kept.
    parameters : array
        One for each kept column.
    """

    sliders: Array
    links: tuple[Array, ...]
    platform: Array
    parameters: Array

    @classmethod
    def of(cls, base: BaseParameters, reduced: bool) -> DenseModel:
        """Return the model for a machine's base parameters, or for all its parameters."""
        n = len(base.robot.legs)
        whole = base.selection.shape[0]
        kept = list(base.kept) if reduced else list(range(whole))
        values = base.values() if reduced else parameters(base.robot)
        starts = range(n, whole, 4)
        blocks = [np.array([k - s for k in kept if s <= k < s + 4], dtype=int) for s in starts]
        sliders = np.array([k for k in kept if k < n], dtype=int)
        return cls(sliders, tuple(blocks[:-1]), blocks[-1], values)

    @property
    def operations(self) -> int:
        """Multiplications and additions of one state, every matrix taken as full.

        A product (a, b) (b, c) counts a c (2 b - 1), an elimination with c right sides about
        2 m^3 / 3 + 2 m^2 c.
        """
        m, columns = len(self.links) // 2, len(self.parameters)
        products = m * len(self.sliders) * (2 * m - 1)
        products += sum(m * len(kept) * (2 * 6 - 1) for kept in self.links)
        elimination = round(2 * m**3 / 3) + 2 * m * m * columns
        return products + elimination + m * (2 * columns - 1)

    def cut(self, terms: PaperTerms) -> tuple[Array, list[Array], list[Array], Array, Array]:
        """Return the matrices with the kept columns only, apart for each link."""
        jacobian, sliders, jacobians, links, platform = terms
        return (
            np.ascontiguousarray(sliders[..., self.sliders]),
            [np.ascontiguousarray(jacobians[:, i]) for i in range(jacobians.shape[1])],
            [np.ascontiguousarray(links[:, i][..., kept]) for i, kept in enumerate(self.links)],
            np.ascontiguousarray(platform[..., self.platform]),
            jacobian,
        )

    def forces(self, cut: tuple[Array, list[Array], list[Array], Array, Array]) -> Array:
        """Return F_a = -J^-T [ J^T Om_p  J_u^T Om_u  J_l^T Om_l  Om_e ] P, shape (b, n)."""
        sliders, jacobians, links, platform, jacobian = cut
        transposed = np.swapaxes(jacobian, -1, -2)
        blocks = [transposed @ sliders]
        blocks += [
            np.swapaxes(j, -1, -2) @ omega for j, omega in zip(jacobians, links, strict=True)
        ]
        bracket = np.concatenate([*blocks, platform], axis=-1)
        return -(np.linalg.solve(transposed, bracket) @ self.parameters)
