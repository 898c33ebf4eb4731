"""Other engines doing our inverse dynamics: platform motion to actuator forces, the whole job.

Each cuts the loops, runs its Newton-Euler algorithm on the tree, and projects the joint forces
through the closure; what is not the engine's is done in closed form. For machines with four legs.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass

import pteron
from peers import mujoco_peers, pinocchio_peers
from peers.calls import Calls
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
        From pose, velocity and acceleration, each (B, 4), to the actuator forces (B, 4).
    seconds : callable
        From the same to the time of one sweep over the batch, in seconds a state, measured inside:
        by C and C++ around their loops, from Python around calls with one state each.
    """

    name: str
    forces: Callable[[Array, Array, Array], Array]
    seconds: Callable[[Array, Array, Array], float]


_BUILDERS: dict[str, Callable[[pteron.Manipulator], Calls | Sweep]] = {
    "Pinocchio, C++": pinocchio_peers.cpp,
    "Pinocchio, Python": pinocchio_peers.python,
    "MuJoCo, C": mujoco_peers.c,
    "MuJoCo, Python": mujoco_peers.python,
}


def peers(robot: pteron.Manipulator) -> list[Peer]:
    """Return the peers that can be built here; what is missing for others is said on stderr.

    Parameters
    ----------
    robot : Manipulator
        A 3T1R machine; its sliders may move along any direction.

    Returns
    -------
    list of Peer

    Raises
    ------
    ValueError
        If the machine has not four legs.
    """
    if not robot.platform.turns:
        raise ValueError(f"{robot.name}: the peers are written for 3T1R machines, with four legs")
    found = []
    for name, build in _BUILDERS.items():
        try:
            peer = build(robot)
        except Missing as missing:
            print(f"{name}: left out, {missing}", file=sys.stderr)
        else:
            found.append(Peer(name, peer.forces, peer.seconds))
    return found
