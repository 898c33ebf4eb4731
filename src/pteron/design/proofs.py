"""What is proved of a design: that all of a cube, or of the required workspace, can be used.

A search looks at points; here interval arithmetic takes in all that lies between them
(`pteron.workspace.prove`), under the floors that the search asks for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pteron.design.design import Design
from pteron.kernels import Array
from pteron.workspace import Box, Cylinder, Proof, prove

_SHARES = (0.9999, 0.999, 0.995, 0.98, 0.95, 0.9)
"""Of the edge that was found: at the whole of it a condition is zero somewhere, and undecided."""

_MOST = 200_000
"""Boxes after which a proof is given up."""


@dataclass(frozen=True)
class ProvedCube:
    """A cube of which every pose keeps reach, limits and floors, at each orientation.

    Attributes
    ----------
    center : array, shape (k,)
        m.
    edge : float
        m.
    found : float
        The edge that the search found, m: a little more than what is proved.
    proofs : tuple of Proof
        One for each orientation.
    """

    center: Array
    edge: float
    found: float
    proofs: tuple[Proof, ...]

    @property
    def words(self) -> str:
        """What is proved, in a sentence."""
        center = ", ".join(f"{round(1000.0 * x, 1) + 0.0:g}" for x in self.center)
        boxes = sum(proof.boxes for proof in self.proofs)
        return (
            f"proved: every position of the cube with edge {1000.0 * self.edge:.1f} mm about "
            f"({center}) mm keeps reach, limits and floors, by intervals over {boxes} boxes"
        )


def proved_cube(design: Design) -> ProvedCube | None:
    """Return the largest cube of a design, so far as it is proved; None where none is."""
    cube = design.cube
    for share in _SHARES:
        half = 0.5 * share * cube.edge
        regions = [
            Box(*(_whole(pose, cube.center + side * half) for side in (-1.0, 1.0)))
            for pose in design.task.orientations
        ]
        proofs = _proved(design, regions)
        if proofs is not None:
            return ProvedCube(cube.center, 2.0 * half, cube.edge, proofs)
    return None


def workspace_proofs(design: Design) -> tuple[Proof, ...]:
    """Return what is proved of the required workspace, a proof for each orientation."""
    asked = design.task.spec.workspace
    if asked is None:
        return ()
    regions: list[Box | Cylinder] = []
    for pose in design.task.orientations:
        if asked.shape == "cylinder":
            assert asked.radius is not None  # the shape says so
            assert asked.height is not None
            x, y, z = np.eye(3)["xyz".index(asked.axis)].tolist()
            center = _whole(pose, np.array(asked.center))
            regions.append(Cylinder(center, asked.radius, asked.height, (x, y, z)))
        else:
            regions.append(Box(*(_whole(pose, np.array(end)) for end in asked.ends)))
    floors = design.task.spec.floors
    return tuple(
        prove(design.robot, one, type_i=floors.type_i, type_ii=floors.type_ii, most=_MOST)
        for one in regions
    )


def _proved(design: Design, regions: list[Box]) -> tuple[Proof, ...] | None:
    floors, found = design.task.spec.floors, []
    for region in regions:
        proof = prove(
            design.robot, region, type_i=floors.type_i, type_ii=floors.type_ii, most=_MOST
        )
        if not proof.holds:
            return None
        found.append(proof)
    return tuple(found)


def _whole(pose: Array, position: Array) -> tuple[float, ...]:
    """Return a position with the angle of a pose."""
    return (*position.tolist(), *pose[len(position) :].tolist())
