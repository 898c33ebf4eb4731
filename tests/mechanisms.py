"""The mechanisms, batch shapes and states that all tests share."""

from dataclasses import replace
from functools import lru_cache
from itertools import cycle, islice

import descriptions
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import pteron

NIGHTLY = pytest.mark.nightly
"""Marks a test, or one of its cases, of a claim that the gate tests elsewhere."""

CLIENTS = pytest.mark.clients
"""Marks what uses the library at length as others do."""

BATCH_SHAPES = [(), (1,), (7,), (3, 5), (0,), (400,)]
"""NumPy evaluates 400 states, CasADi fewer."""


def with_elbows(robot, signs):
    """Return the machine in the working mode that a text such as "+-+-" names."""
    legs = tuple(
        replace(leg, elbow=1 if sign == "+" else -1)
        for leg, sign in zip(robot.legs, signs, strict=True)
    )
    return replace(robot, legs=legs)


def unit(rng, across=None):
    """Return a random unit vector, perpendicular to another if that is given."""
    v = rng.normal(size=3)
    if across is not None:
        v = np.cross(across, v)
    return v / np.linalg.norm(v)


def inertia(rng, length):
    """Return the inertia of a real link or platform, its centre of mass off both axes."""
    mass = rng.uniform(0.2, 0.6)
    x, y = rng.uniform(-0.6, 0.6) * length, rng.uniform(-0.1, 0.1) * length
    return pteron.bodies.PlanarInertia.of_body(
        mass, (x, y), mass * (x * x + y * y + (0.3 * length) ** 2)
    )


def rod_inertia(rng, length):
    """Return the inertia of a real rod about its platform end."""
    mass, x = rng.uniform(0.2, 0.6), -length * rng.uniform(0.3, 0.7)
    return pteron.bodies.RodInertia.of_body(mass, (x,), mass * (x * x + (0.3 * length) ** 2))


def slider_leg(rng, d, c, **point):
    """Return a P-R-R-R leg with nothing special about it that reaches c."""
    lu, ll = rng.uniform(0.15, 0.25, 2)
    across = unit(rng, d)
    e = d + 0.5 * rng.normal(size=3)
    e /= np.linalg.norm(e) * np.sign(e @ d)
    reach = rng.uniform(0.75, 0.9) * np.hypot(lu, ll) * across
    return pteron.legs.PRRR(
        guide_point=c - reach + rng.uniform(-0.1, 0.1) * e,
        direction=d,
        upper_length=lu,
        lower_length=ll,
        slider_mass=rng.uniform(0.3, 0.8),
        upper=inertia(rng, lu),
        lower=inertia(rng, ll),
        slider_direction=e,
        elbow=int(rng.choice([1, -1])),
        **point,
    )


def crank_leg(rng, d, c, **point):
    """Return an R-S-S leg that reaches c, its rod at 35 to 70 degrees from d and from the crank."""
    a = unit(rng, d)
    lu, ll = rng.uniform(0.1, 0.15), rng.uniform(0.25, 0.35)
    crank = lu * unit(rng, d)
    elbow = int(rng.choice([1, -1]))
    lean, side = rng.uniform(0.6, 1.2, 2) * [1, -elbow]
    across = np.cross(d, crank / lu)
    rod = np.cos(lean) * d + np.sin(lean) * (np.cos(side) * crank / lu + np.sin(side) * across)
    lower = rod_inertia(rng, ll)
    return pteron.legs.RSS(
        guide_point=c - crank - ll * rod,
        direction=d,
        zero_direction=a,
        upper_length=lu,
        lower_length=ll,
        upper=inertia(rng, lu),
        lower=lower,
        elbow=elbow,
        **point,
    )


def rod_leg(rng, n, c, **point):
    """Return a P-S-S leg that reaches c, its rod along n and 25 to 60 degrees from the guide."""
    ll = rng.uniform(0.25, 0.35)
    e, elbow = _guide(rng, n, unit(rng, n))
    return pteron.legs.PSS(
        guide_point=c - ll * n + rng.uniform(-0.1, 0.1) * e,
        slider_direction=e,
        lower_length=ll,
        slider_mass=rng.uniform(0.3, 0.8),
        lower=rod_inertia(rng, ll),
        elbow=elbow,
        **point,
    )


def _guide(rng, n, across):
    """Return a guide's direction, 25 to 60 degrees from a link along n, and the elbow."""
    lean, elbow = rng.uniform(0.4, 1.1), int(rng.choice([1, -1]))
    return elbow * (np.cos(lean) * n + np.sin(lean) * across), elbow


def planar_slider_leg(rng, n, c, *, k, **point):
    """Return a P-R-R leg of the plane of normal k, its link along n."""
    ll = rng.uniform(0.25, 0.35)
    e, elbow = _guide(rng, n, np.cross(k, n) * rng.choice([1, -1]))
    return pteron.legs.PRR(
        guide_point=c - ll * n + rng.uniform(-0.1, 0.1) * e + rng.uniform(-0.1, 0.1) * k,
        slider_direction=e,
        direction=rng.choice([1, -1]) * k,
        lower_length=ll,
        slider_mass=rng.uniform(0.3, 0.8),
        lower=inertia(rng, ll),
        elbow=elbow,
        **point,
    )


def planar_crank_leg(rng, n, c, *, k, **point):
    """Return an R-R-R leg of the plane of normal k, its last link along n."""
    lu, ll = rng.uniform(0.15, 0.2), rng.uniform(0.2, 0.3)
    elbow = int(rng.choice([1, -1]))
    side, d = -elbow * rng.uniform(0.8, 2.2), rng.choice([1, -1]) * k
    crank = lu * (np.cos(side) * n - np.sin(side) * np.cross(d, n))
    return pteron.legs.RRR(
        guide_point=c - crank - ll * n + rng.uniform(-0.1, 0.1) * k,
        direction=d,
        zero_direction=unit(rng, d),
        upper_length=lu,
        lower_length=ll,
        upper=inertia(rng, lu),
        lower=inertia(rng, ll),
        elbow=elbow,
        **point,
    )


def ram_leg(rng, n, c, *, k, **point):
    """Return an R-P-R leg of the plane of normal k, its ram along n."""
    length = rng.uniform(0.4, 0.6)
    return pteron.legs.RPR(
        guide_point=c - length * n + rng.uniform(-0.1, 0.1) * k,
        direction=rng.choice([1, -1]) * k,
        limits=(0.7 * length, 1.3 * length),
        upper=inertia(rng, 0.6 * length),
        lower=inertia(rng, 0.6 * length),
        **point,
    )


def shaft_leg(rng, n, c, *, k, **point):
    """Return an R-U-P-U leg less than 45 degrees from k, wherever n points."""
    across = rng.uniform(0.0, 1.0) * np.cross(k, n)
    length = rng.uniform(0.3, 0.4)
    return pteron.legs.RUPU(
        guide_point=c + length * (k + across) / np.linalg.norm(k + across),
        ratio=rng.uniform(1.0, 3.0) * rng.choice([1, -1]),
        upper=rod_inertia(rng, -0.5 * length),
        lower=rod_inertia(rng, 0.5 * length),
        **point,
    )


LEGS = {
    "P": slider_leg,
    "R": crank_leg,
    "S": rod_leg,
    "U": shaft_leg,
    "C": planar_crank_leg,
    "L": planar_slider_leg,
    "T": ram_leg,
}


def random_machine(seed, kinds):
    """Return a machine with nothing special about it, built around a pose that it reaches: zero.

    `kinds` holds a letter for each leg: P (P-R-R-R), R (R-S-S), S (P-S-S), U (R-U-P-U), C (planar
    R-R-R), L (planar P-R-R) and T (planar R-P-R); one of the last three makes the machine planar.
    The number of legs says whether the platform turns, an I at the end that it slides, as an I4's.
    Of P-R-R-R legs alone `kinds` may be whether it turns.
    """
    if isinstance(kinds, bool):
        kinds = "PPPP" if kinds else "PPP"
    rng = np.random.default_rng(seed)
    while True:
        robot = _drawn_machine(rng, f"random {kinds} {seed}", kinds)
        home = np.zeros((1, robot.freedom))
        bend, held = descriptions.distances_from_singular(descriptions.describe(robot), home)
        if bend > 0.4 and held > 0.1:
            return robot


MOTIONS = {(False, 3): "3T", (False, 4): "3T1R", (True, 2): "2T", (True, 3): "2T1R"}


def _drawn_machine(rng, name, kinds):
    slides, kinds = "I" in kinds, kinds.removesuffix("I")
    flat = bool(set(kinds) & set("CLT"))
    motion = MOTIONS[flat, len(kinds)]
    axis = unit(rng)
    x_axis = unit(rng, axis)
    frame = np.column_stack([x_axis, np.cross(axis, x_axis), axis])
    while True:
        directions = [unit(rng, axis if flat else None) for _ in kinds]
        if np.linalg.svd(directions, compute_uv=False)[1 if flat else 2] > 0.4:
            break
    articulated = motion in ("3T1R", "2T1R") and set(kinds) != {"P"}
    legs = []
    for kind, d in zip(kinds, directions, strict=True):
        s0 = rng.uniform(-0.06, 0.06, 3)
        t0 = rng.uniform(-0.06, 0.06, 3) if articulated else np.zeros(3)
        if motion == "2T" and legs:
            s0[:2] = legs[0].platform_point[:2]
        if slides:
            s0[2] = 0.0
        if flat and kind in "PRS":
            d += rng.uniform(-0.7, 0.7) * axis
            d /= np.linalg.norm(d)
        point = {"platform_point": s0, "fixed_offset": t0}
        if kind in "CLTU":
            point["k"] = axis
        legs.append(LEGS[kind](rng, d, (0.0 if slides else frame @ s0) + t0, **point))
    parts = {}
    if articulated:
        parts["bars"] = [
            pteron.platforms.Bar(rng.uniform(0.1, 0.3), (*rng.uniform(-0.06, 0.06, 2), 0.0))
            for _ in range(2)
        ]
        parts["geared"] = [
            pteron.platforms.GearedPart(rng.uniform(1e-5, 1e-4), rng.uniform(-6.0, 6.0))
        ]
    platform = pteron.platforms.Platform(motion, inertia(rng, 0.08), axis, x_axis, slides, **parts)
    return pteron.Manipulator(name, platform, tuple(legs), 9.81 * unit(rng))


def scaled(robot, factor):
    """Return the machine with every length times a factor; masses stay."""

    def times(values, power=1):
        return tuple(factor**power * v for v in values)

    def body(inertia):
        if isinstance(inertia, float):
            return inertia
        about = inertia.inertia
        return replace(
            inertia,
            first_moment=times(inertia.first_moment),
            inertia=times(about, 2) if isinstance(about, tuple) else factor**2 * about,
        )

    legs = []
    for leg in robot.legs:
        changes = {
            key: times(v) if isinstance(getattr(leg, key), tuple) else factor * v[0]
            for key, v in leg.metres.items()
        }
        if getattr(leg, "bar_length", None) is not None:
            changes["bar_length"] = factor * leg.bar_length
        masses = {"upper", "lower"} & set(leg.every_key())
        legs.append(replace(leg, **changes, **{key: body(getattr(leg, key)) for key in masses}))
    platform = replace(
        robot.platform,
        inertia=body(robot.platform.inertia),
        tool=times(robot.platform.tool),
        center=robot.platform.center and times(robot.platform.center),
        bars=tuple(replace(bar, hinge=times(bar.hinge)) for bar in robot.platform.bars),
        geared=tuple(replace(g, inertia=factor**2 * g.inertia) for g in robot.platform.geared),
    )
    return replace(robot, legs=tuple(legs), platform=platform, radii=None)


_LOADED = {name: pteron.load(name) for name in pteron.catalog()}
CATALOG = {name: robot for name, robot in _LOADED.items() if not robot.platform.tilts}
"""The machines of the catalog that every loop over it takes."""
TILTED = {name: robot for name, robot in _LOADED.items() if robot.platform.tilts}
"""Those whose platforms tilt: tests choose among them, as programs of six legs take long."""


def _turned(name, seed, **options):
    return pteron.turned(CATALOG[name], Rotation.random(rng=seed).as_matrix(), **options)


NEAREST = ("delta", "quadrupteron", "quadrupteron-oblique", "tripteron", "tripteron-oblique")
"""Machines of the catalog on which every claim is tested; the others have tests of their own."""

MECHANISMS = {
    **{name: CATALOG[name] for name in NEAREST},
    "quadrupteron +-+-": with_elbows(CATALOG["quadrupteron"], "+-+-"),
    "quadrupteron-oblique +--+": with_elbows(CATALOG["quadrupteron-oblique"], "+--+"),
    "quadrupteron, gravity along x": replace(CATALOG["quadrupteron"], gravity=(9.81, 0.0, 0.0)),
    "tripteron, no gravity": replace(CATALOG["tripteron"], gravity=(0.0, 0.0, 0.0)),
    "quadrupteron turned": _turned("quadrupteron", 1),
    "tripteron on a wall": _turned("tripteron", 2, gravity=False),
    "delta on a wall": _turned("delta", 3, gravity=False),
    "random 3T1R 0": random_machine(0, "PPPP"),
    "random 3T1R 1": random_machine(1, "PPPP"),
    "random 3T 0": random_machine(0, "PPP"),
    "random RRR 0": random_machine(0, "RRR"),
    "random RRR 1": random_machine(1, "RRR"),
    "random PRR 0": random_machine(0, "PRR"),
    "random RPP 0": random_machine(0, "RPP"),
}
"""Legs of two links, under a platform that moves in space."""

MACHINES = {
    **MECHANISMS,
    "random PRSU 0": random_machine(0, "PRSU"),
    "random PRSSI 0": random_machine(0, "PRSSI"),
    "five-bar": CATALOG["five-bar"],
    "random CTL 0": random_machine(0, "CTL"),
}
"""These and one of each other kind of leg, closure and platform."""

GATE = (
    *("quadrupteron", "tripteron-oblique", "delta", "random PRR 0"),
    *("random PRSU 0", "random PRSSI 0", "five-bar", "random CTL 0"),
)
"""Eight machines that stand for all, see `test_gate`.

One for each closure under each platform that it serves, chosen so that together they have every
kind of leg, both elbows, legs of one kind and mixed ones, the special geometries of the catalog and
generic ones, bars and gears, and gravity along the platform's axis and askew. Claims about every
machine are tested on these by `make test`, and on all others by `make nightly`.
"""


LARGE = ("clearances", "least_clearances", "adaptive", "adaptive_drives", "paper_terms")
"""Functions that take a C compiler seconds; the gate compiles the others."""


def gated(cases, gate=GATE, mark=NIGHTLY):
    """Return the cases of a claim, each once; those not of the gate wait as the mark says."""
    every = dict.fromkeys(cases)
    assert not set(gate).isdisjoint(every)
    return [case if case in gate else pytest.param(case, marks=mark) for case in every]


def several(cases, gate, mark=NIGHTLY):
    """Return the cases of a claim with several arguments; those not of the gate wait likewise."""
    return [case if case in gate else pytest.param(*case, marks=mark) for case in cases]


TURNS = {}
"""By file and its gate, the cases that had a turn."""


def in_turn(cases, gate=GATE, share=2, argument="name", **options):
    """Return what parametrizes the claims of a file, each in the gate by the next of its cases.

    A file with claims enough has each case of its gate, and each claim `share` of them: a machine
    is tried against what is said of machines, and a claim against kinds of machines, but not every
    pair of the two before `make nightly`.
    """
    own = [case for case in gate if case in set(cases)]
    turns = cycle(own)

    def parametrized(test):
        chosen = list(islice(turns, share))
        TURNS.setdefault((test.__module__, *own), set()).update(chosen)
        return pytest.mark.parametrize(argument, gated(cases, chosen), **options)(test)

    return parametrized


@lru_cache
def states(robot, count, seed=0):
    """Return random poses away from singularities, velocities and accelerations."""
    rng = np.random.default_rng(seed)
    pose = pteron.random_poses(robot, count, seed=rng, type_i=0.3, type_ii=0.15)
    found = pose, rng.normal(size=pose.shape), 10.0 * rng.normal(size=pose.shape)
    for array in found:
        array.setflags(write=False)
    return found


def relative_error(found, expected):
    """Return the largest error of any row, relative to the row's largest entry."""
    scale = np.abs(expected).max(axis=-1, keepdims=True)
    return float((np.abs(np.asarray(found) - expected) / scale).max())


def with_limits(robot, low, high):
    return replace(robot, legs=tuple(replace(leg, limits=(low, high)) for leg in robot.legs))


def fourfold():
    """Return a layout with fourfold symmetry about k, which is singular everywhere."""
    robot = MECHANISMS["quadrupteron"]
    legs = []
    for i, leg in enumerate(robot.legs):
        turn = Rotation.from_euler("z", 90 * i, degrees=True).as_matrix()
        legs.append(
            replace(
                leg,
                guide_point=turn @ [0.25, 0.0, 0.0],
                platform_point=turn @ [0.04, 0.0, 0.0],
                direction=turn @ np.array([0.0, 0.6, 0.8]),
                upper_length=0.16,
                lower_length=0.16,
            )
        )
    return replace(robot, legs=tuple(legs))


MIXTURES = [
    *("PPP", "RRR", "SSS", "PRS"),  # 3T
    *("PPPP", "RRRR", "SSSS", "PPSS", "RRRU", "PRSU", "PRSSI"),  # 3T1R
    *("CC", "LL", "CL", "CS", "TT", "TL"),  # 2T
    *("CCC", "LLL", "CCL", "CCU", "CPR", "TTT", "TCL", "TTU"),  # 2T1R
]
"""The letters are those of `random_machine`."""
