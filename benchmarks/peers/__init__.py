"""Inverse dynamics by other engines, from platform motion to actuator forces.

Each cuts the loops, runs its Newton-Euler algorithm on the tree, and projects the joint forces
through the closure; what is not the engine's is done in closed form. Tuned peers have the best
flags, buffers, stages and trees that we found; the others are what a good user writes first. For
machines with four P-R-R-R legs, those of legs R-S-S, P-S-S and R-R-R, and, in Pinocchio, hexapods
of legs U-P-S, P-S-S and R-S-S.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass

import pteron
from peers import mujoco_peers, pinocchio_peers
from peers.calls import Call, Calls
from peers.closure import Array
from peers.library import Missing, Sweep

__all__ = ["Array", "Peer", "peers"]


@dataclass(frozen=True)
class Peer:
    """An engine that does the whole job.

    Parameters
    ----------
    name : str
        The engine and the language it is called from.
    forces : callable
        From pose, velocity and acceleration, each (B, m), to the actuator forces (B, n).
    seconds : callable
        From the same to the time of one sweep over the batch, in seconds a state, measured inside:
        by C and C++ around their loops, from Python around calls with one state each.
    call : callable or None
        From one state to its forces, for a peer that is called from Python.
    """

    name: str
    forces: Callable[[Array, Array, Array], Array]
    seconds: Callable[[Array, Array, Array], float]
    call: Call | None


_BUILDERS: dict[str, Callable[[pteron.Manipulator], Calls | Sweep]] = {
    "Pinocchio, C++, tuned": pinocchio_peers.cpp_tuned,
    "Pinocchio, C++, usual flags": pinocchio_peers.cpp_usual,
    "Pinocchio, C++, -O3": pinocchio_peers.cpp_plain,
    "Pinocchio, C, CasADi's code": pinocchio_peers.c_generated,
    "Pinocchio, Python, tuned": pinocchio_peers.python_tuned,
    "Pinocchio, Python, usual calls": pinocchio_peers.python_usual,
    "MuJoCo, C, tuned": mujoco_peers.c_tuned,
    "MuJoCo, C, loops closed by constraints": mujoco_peers.c_usual,
    "MuJoCo, Python, tuned": mujoco_peers.python_tuned,
}


def peers(robot: pteron.Manipulator, *, quick: bool = False) -> list[Peer]:
    """Return the peers that can be built here; what is missing for others is said on stderr.

    Parameters
    ----------
    robot : Manipulator
        A 3T1R machine of P-R-R-R legs, any of R-S-S, P-S-S and R-R-R legs, or a hexapod.
    quick : bool
        Whether to leave out Pinocchio in C++, which may take most of a minute to compile.

    Returns
    -------
    list of Peer

    Raises
    ------
    ValueError
        If the machine is neither.
    """
    kinds = {leg.type for leg in robot.legs}
    known = {"RSS", "PSS", "UPS"} if robot.platform.tilts else {"RSS", "PSS", "RRR"}
    if not ((kinds == {"PRRR"} and robot.platform.turns) or kinds <= known):
        raise ValueError(f"{robot.name}: the peers are not written for its legs")
    found = []
    for name, build in _BUILDERS.items():
        if quick and name.startswith("Pinocchio, C"):
            continue
        try:
            peer = build(robot)
        except Missing as missing:
            print(f"{name}: left out, {missing}", file=sys.stderr)
        else:
            call = peer.call if isinstance(peer, Calls) else None
            found.append(Peer(name, peer.forces, peer.seconds, call))
    return found
