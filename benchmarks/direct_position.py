"""Platforms that tilt have all their poses: as many as other solvers and dense searches find.

Dietmaier's machine with its 40 real poses; then 1000 random machines of 6 U-P-S legs with joint
coordinates that a pose has, of which `direct_position_counts.txt` has the number of real poses by
other solvers: general ones, with the base or both figures in a plane, with platform points that
coincide in pairs (6-3), every third of them turned as a whole; and 200 beside Dietmaier's. On 50 of
them, and on wrists, ankles and tripods, Newton's steps from many poses look for what is missing. Of
five machines with five freedoms the poses in a box are proved by intervals. Times are of one
machine a call, and of a batch. `--quick` takes fewer.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from measuring import quick

import pteron
from pteron.bodies.inertia import RodInertia, SpatialInertia
from pteron.kernels import Array, numeric
from pteron.legs import UPS
from pteron.platforms import Platform
from pteron.workspace import proved_poses

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

tilting: Any = import_module("tilting")

_BASE = """
0 0 0, 1.107915 0 0, 0.549094 0.756063 0, 0.735077 -0.223935 0.525991,
0.514188 -0.526063 -0.368418, 0.590473 0.094733 -0.205018"""
_TOP = """
0 0 0, 0.542805 0 0, 0.956919 -0.528915 0, 0.665885 -0.353482 1.402538,
0.478359 1.158742 0.107672, -0.137087 -0.235121 0.353913"""
_LENGTHS = [1.0, 0.645275, 1.086284, 1.503439, 1.281933, 0.771071]
_COUNTS = Path(__file__).with_name("direct_position_counts.txt")
_KINDS = (*5 * ("general",), *2 * ("base plane",), "plane", "6-3", "6-3 plane")
_FIVE = (*2 * (("PRUR",),), *2 * (("RPUR",),), ("PRUR", "UPS", "RPUR", "RSS", "PSS"))
_MOST = 1000
_STARTS = 100_000
_SAME = 1e-6


def hexapod(base: Array, top: Array) -> pteron.Manipulator:
    """Return a machine of 6 U-P-S legs between points of the base and of the platform."""
    upper, lower = (RodInertia.of_body(1.0, (x,), 0.1) for x in (0.1, -0.1))
    legs = tuple(
        UPS(tuple(r), tuple(s), upper, lower, (0.1, 5.0))
        for r, s in zip(np.array(base).tolist(), np.array(top).tolist(), strict=True)
    )
    body = SpatialInertia(1.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 1.0, 0.0, 1.0))
    return pteron.Manipulator("hexapod", Platform("3T3R", body), legs, (0.0, 0.0, -9.81))


def dietmaiers() -> Array:
    """Return the points of Dietmaier's machine on the base and on the platform."""
    parts = (np.fromstring(part.replace(",", " "), sep=" ") for part in (_BASE, _TOP))
    return np.array([part.reshape(6, 3) for part in parts])


def kind_of(seed: int) -> str:
    """Return the kind of a random machine; those of many poses are beside Dietmaier's."""
    return _KINDS[seed % len(_KINDS)] if seed < _MOST else "many poses"


def drawn(seed: int) -> tuple[pteron.Manipulator, Array]:
    """Return a random machine and joint coordinates that a pose of it has."""
    rng, kind = np.random.default_rng([7, seed]), kind_of(seed)
    if kind == "many poses":
        size, (base, top) = 10.0 ** rng.uniform(-4.0, -1.3), dietmaiers()
        base, top = (part + size * rng.normal(size=(6, 3)) for part in (base, top))
        return hexapod(base, top), np.array(_LENGTHS) + size * rng.normal(size=6)
    base, top = rng.normal(size=(6, 3)), 0.6 * rng.normal(size=(6, 3))
    if "plane" in kind:
        base[:, 2] = 0.0
    if kind.endswith("plane") and kind != "base plane":
        top[:, 2] = 0.0
    if "6-3" in kind:
        top[1::2] = top[::2]
    pose = np.concatenate([rng.normal(size=3), rng.uniform(-1.0, 1.0, 3)])
    robot = hexapod(base, top)
    joints: Array = pteron.inverse_kinematics(robot, pose)
    if seed % 3 == 0:
        robot = pteron.turned(robot, tilting.rotation(rng))
    return robot, joints


def searched(robot: pteron.Manipulator, joints: Array) -> int:
    """Return how many poses Newton's steps, of 0.5 at most, find from many."""
    step, platform = numeric(robot, "newton_step"), robot.platform
    rng = np.random.default_rng(0)
    at = rng.uniform(-np.pi, np.pi, (2000 if quick() else _STARTS, robot.freedom))
    at[:, ~platform.angular] = 1.5 * rng.normal(size=at[:, ~platform.angular].shape)
    with np.errstate(all="ignore"):
        for _ in range(60):
            move = step(joints, at)[0] - at
            at += move * np.minimum(1.0, 0.5 / np.linalg.norm(move, axis=-1, keepdims=True))
        at = at[np.isfinite(at).all(axis=-1)]
        at = at[step(joints, at)[1] < 1e-13]
    place, axes = platform.placement(at)
    known = np.concatenate([place, axes.reshape(-1, 9)], axis=-1)
    count = 0
    while len(known):
        count += 1
        known = known[np.abs(known - known[0]).max(axis=-1) > _SAME]
    return count


def real(poses: Array) -> int:
    """Return how many rows are no NaN."""
    return int(np.isfinite(poses[..., 0]).sum())


def main() -> None:
    """Print counts and times."""
    most, looked = (20, 4) if quick() else (_MOST, 50)
    robot = hexapod(*dietmaiers())
    poses = pteron.direct_kinematics(robot, _LENGTHS)
    back = np.abs(pteron.inverse_kinematics(robot, poses) - _LENGTHS).max()
    print(f"Dietmaier's machine: {len(poses)} of 40 poses, lengths back to {back:.0e} m")
    given = np.loadtxt(_COUNTS, dtype=int).ravel()
    times: dict[str, list[float]] = {}
    counts: dict[str, Counter[int]] = {}
    other, sought = [], []
    for seed in (*range(most), *range(_MOST, _MOST + most // 5)):
        kind = kind_of(seed)
        robot, joints = drawn(seed)
        pteron.direct_kinematics(robot, joints)  # its programs are built
        begin = time.process_time()
        count = real(pteron.direct_kinematics(robot, joints))
        times.setdefault(kind, []).append(1e3 * (time.process_time() - begin))
        counts.setdefault(kind, Counter())[count] += 1
        if count != given[seed]:
            other.append((seed, count, int(given[seed])))
        if seed < looked and (found := searched(robot, joints)) != count:
            sought.append((seed, count, found))
    print("machines   kind         ms each: median, 95 %   real poses: machines")
    for kind, each in times.items():
        told = " ".join(f"{n}:{counts[kind][n]}" for n in sorted(counts[kind]))
        middle, high = np.quantile(each, [0.5, 0.95])
        print(f"{len(each):8d}   {kind:11s} {middle:14.2f} {high:8.2f}   {told}")
    print(f"other numbers than the other solvers': {other or 'none'} (machine, ours, theirs)")
    print(f"than dense searches of {looked}: {sought or 'none'} (machine, ours, found)")
    for motion, kinds in tilting.LEGS.items():
        if motion != "3T2R":  # of which not all poses are claimed
            others(motion, kinds)
    for seed, kinds in enumerate(_FIVE[: 1 if quick() else None]):
        proved_in_box(kinds, seed)
    robot, joints = drawn(0)
    states = pteron.direct_kinematics(robot, joints)[0]
    rng = np.random.default_rng(0)
    states = states + 0.3 * rng.normal(size=(16 if quick() else 512, 6))
    joints = pteron.inverse_kinematics(robot, states)
    begin = time.process_time()
    pteron.direct_kinematics(robot, joints)
    spent = time.process_time() - begin
    print(f"in a batch of {len(joints)}: {1e3 * spent / len(joints):.2f} ms each")


def proved_in_box(kinds: tuple[str, ...], seed: int) -> None:
    """Print the poses of a 3T2R machine in a box, proved, and those of Newton's method in it."""
    robot, home = tilting.machine("3T2R", kinds, seed)
    pose = tilting.states(robot, home, 1, seed)[0][0]
    joints = pteron.inverse_kinematics(robot, pose)
    size = float(np.mean([leg.size for leg in robot.legs]))
    half = np.where(robot.platform.angular, np.radians(30.0), 0.2 * size)
    begin = time.process_time()
    proved = proved_poses(robot, joints, [pose - half, pose + half])
    spent = time.process_time() - begin
    listed = pteron.direct_kinematics(robot, joints)
    within = int((np.abs(listed - pose) <= half).all(axis=-1).sum())
    print(
        f"3T2R, {' '.join(kinds)}: {len(proved.poses)} poses within 20 % of {size:.2f} m and "
        f"30 deg, proved to be all: {proved.is_complete}; {proved.examined} boxes, {spent:.1f} s; "
        f"Newton's method finds {within}"
    )


def others(motion: str, kinds: tuple[str, ...]) -> None:
    """Print how often dense searches agree on machines of a motion, with each kind of leg."""
    alike, all_counts, worse = 0, Counter[int](), []
    for kind in kinds:
        for seed in range(1 if quick() else 10):
            robot, home = tilting.machine(motion, (kind,), seed)
            poses = tilting.states(robot, home, 1, seed)[0]
            if not len(poses):
                continue  # none in reach
            joints = pteron.inverse_kinematics(robot, poses[0])
            count = real(pteron.direct_kinematics(robot, joints, all_branches=True))
            found = searched(robot, joints)
            all_counts[count] += 1
            alike += found == count
            if found != count:
                worse.append((kind, seed, count, found))
    told = " ".join(f"{n}:{all_counts[n]}" for n in sorted(all_counts))
    searches = sum(all_counts.values())
    print(f"{motion}: {alike} of {searches} dense searches agree, {told} {worse or ''}")


if __name__ == "__main__":
    main()
