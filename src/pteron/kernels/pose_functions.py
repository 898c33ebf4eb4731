"""Functions of poses and of their rates that can be compiled, with the conditions they need."""

from __future__ import annotations

from functools import partial

import casadi as ca

from pteron.equations import (
    closing,
    kinematics,
)
from pteron.equations.clearance import clearances, least_clearances
from pteron.equations.constraints import constraint_measure
from pteron.equations.edges import edges
from pteron.equations.machine import Machine
from pteron.equations.singular_distance import type_ii_distances
from pteron.kernels.entries import (
    BENT,
    MOTION,
    MOVED,
    POSE,
    RATE,
    TABLE,
    TYPE_II,
    Entry,
    Outputs,
    Symbols,
    entry,
    stacked,
    state,
)


@entry(POSE, ("reach",))
def _inverse_kinematics(m: Machine, v: Symbols) -> Outputs:
    # A slider's coordinate exists out of reach too; a machine that cannot be there has none.
    beyond = kinematics.beyond_reach(m, v["pose"])
    return {"joints": kinematics.inverse_position(m, v["pose"]) + beyond}


@entry(POSE)
def _joint_coordinates(m: Machine, v: Symbols) -> Outputs:
    return {"joints": kinematics.inverse_position(m, v["pose"])}


@entry(POSE, ("reach",))
def _link_vectors(m: Machine, v: Symbols) -> Outputs:
    l_u, l_l = kinematics.link_vectors(state(m, v))
    return {"l_u": l_u, "l_l": l_l}


def _poses(m: Machine, v: Symbols, *, reached: bool) -> Outputs:
    poses = kinematics.direct_position(m, v["joints"], reached=reached).T
    return {"poses": (poses, poses.shape)}


TABLE["direct_kinematics"] = Entry(("joints",), partial(_poses, reached=True))
TABLE["closure_poses"] = Entry(("joints",), partial(_poses, reached=False))


@entry(("joints",))
def _closure_rows(m: Machine, v: Symbols) -> Outputs:
    found = closing.closure_rows(m, v["joints"])
    rows = {name: (part, part.shape) for name, part in found._asdict().items()}
    return {**rows, "origin": found.origin, "size": found.size}


@entry(("joints", "pose"))
def _newton_step(m: Machine, v: Symbols) -> Outputs:
    stepped, missed = closing.newton_step(m, v["joints"], v["pose"])
    return {"stepped": stepped, "missed": missed}


@entry(("joints", "pose"))
def _direct_step(m: Machine, v: Symbols) -> Outputs:
    found, measure, bent = closing.direct_step(m, v["joints"], v["pose"], TYPE_II)
    return {"found": found, "type_ii": measure, "bent": bent}


@entry(("joints", "pose"))
def _followed_step(m: Machine, v: Symbols) -> Outputs:
    found = closing.followed_step(m, v["joints"], v["pose"], TYPE_II)
    return {"found": found.pose, "type_ii": found.measure}


@entry(POSE)
def _reach(m: Machine, v: Symbols) -> Outputs:
    found = kinematics.reach(m, v["pose"])
    return {
        name: ca.vertcat(*(getattr(leg, name) for leg in found))
        for name in ("margin", "type_i", "spread")
    }


@entry(POSE)
def _passive_room(m: Machine, v: Symbols) -> Outputs:
    shares, metres = kinematics.passive_margins(m, v["pose"])
    return {"shares": shares, "metres": metres}


@entry(POSE)
def _room(m: Machine, v: Symbols) -> Outputs:
    return {"room": ca.vertcat(*(edge.value for edge in edges(m, v["pose"])))}


@entry(POSE, ("reach",))
def _joint_points(m: Machine, v: Symbols) -> Outputs:
    return {"points": kinematics.chain_points(state(m, v))}


@entry(POSE)
def platform_points(m: Machine, v: Symbols) -> Outputs:
    """Return the platform points in the base frame."""
    points = m.platform.motion(v["pose"], *[ca.SX.zeros(m.freedom)] * 2).points
    return {"points": ca.vertcat(*(point.position.T for point in points))}


@entry(POSE)
def _discriminants(m: Machine, v: Symbols) -> Outputs:
    found = kinematics.reach(m, v["pose"])
    return {"discriminants": ca.vertcat(*(leg.discriminant for leg in found))}


@entry(POSE)
def _squared_type_i(m: Machine, v: Symbols) -> Outputs:
    # Finite and smooth out of reach too, where it is negative.
    found = kinematics.reach(m, v["pose"])
    return {"squares": ca.vertcat(*(leg.discriminant / leg.scale for leg in found))}


@entry(POSE)
def _type_ii(m: Machine, v: Symbols) -> Outputs:
    at = state(m, v)
    return {"type_ii": m.closure.measure(at.platform, at.legs)}


@entry(POSE, BENT)
def _type_ii_distances(m: Machine, v: Symbols) -> Outputs:
    return dict(type_ii_distances(m, v["pose"]))


@entry(POSE, ("reach",))
def _clearances(m: Machine, v: Symbols) -> Outputs:
    return {"distances": stacked(clearances(m, v["pose"]))}


@entry(POSE, ("reach",))
def _least_clearances(m: Machine, v: Symbols) -> Outputs:
    return {"distances": stacked(least_clearances(m, v["pose"]))}


@entry(POSE, ("reach",))
def _constraint(m: Machine, v: Symbols) -> Outputs:
    return {"constraint": constraint_measure(m, state(m, v))}


@entry(POSE, ("rows",))
def _jacobian(m: Machine, v: Symbols) -> Outputs:
    return {"jacobian": kinematics.jacobian(state(m, v))}


@entry(POSE, ("rows",))
def _twist_jacobian(m: Machine, v: Symbols) -> Outputs:
    return {"rows": kinematics.twist_jacobian(state(m, v))}


@entry(RATE)
def _twist(m: Machine, v: Symbols) -> Outputs:
    platform = m.platform.motion(v["pose"], *[ca.SX.zeros(m.freedom)] * 2)
    return {"twist": ca.mtimes(platform.twist_rows, v["velocity"])}


@entry((*POSE, "twist"), ("angles",))
def _velocity_of_twist(m: Machine, v: Symbols) -> Outputs:
    velocity, rest = m.platform.motion(v["pose"], *[ca.SX.zeros(m.freedom)] * 2).velocity_of(
        v["twist"]
    )
    return {"velocity": velocity, "rest": rest}


@entry(POSE, BENT)
def _link_jacobians(m: Machine, v: Symbols) -> Outputs:
    upper, lower = kinematics.link_jacobians(state(m, v))
    return {"upper": upper, "lower": lower}


@entry(POSE, BENT)
def _joint_screws(m: Machine, v: Symbols) -> Outputs:
    return {"screws": [s.T for s in kinematics.joint_screws(state(m, v))]}


def _joint_motion(m: Machine, v: Symbols) -> Outputs:
    at, order = state(m, v), int("acceleration" in v)
    links, passive = kinematics.link_turning(at, order), kinematics.passive_motion(at, order)
    return {
        "actuated": kinematics.driven_motion(at, order),
        "upper_links": links[:, 0],
        "lower_links": links[:, 1],
        "passive": (passive, passive.shape),
    }


TABLE["joint_rates"] = Entry(RATE, _joint_motion, BENT)
TABLE["joint_accelerations"] = Entry(MOTION, _joint_motion, BENT)


@entry(("pose", "joint_rates", "joint_accelerations"), (*MOVED, "type II"))
def _platform_motion(m: Machine, v: Symbols) -> Outputs:
    velocity, acceleration = kinematics.platform_rates(
        m, v["pose"], v["joint_rates"], v["joint_accelerations"]
    )
    return {"velocity": velocity, "acceleration": acceleration}
