"""Chosen Deltas and linear Deltas against their limits, by NumPy, statics and beam formulas alone.

Each task is solved by `choose_machine`; the machine's file is read as TOML, and at random poses of
the workspace are computed from its numbers alone: forces of the drives at rest from the directions
of the rods and the weights of the bodies, the tool's sag by Castigliano's theorem, compression of
the rods at rest, and the rods' frequency. Printed is, for each limit, the worst value found over
the one that `choose` states: above 1 the statement is exceeded. Compression in motion and the
frequency of the whole machine, which `choose` counts too, are worse. `--quick` does two tasks.
"""

from __future__ import annotations

import tomllib
from math import inf, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from measuring import quick

from pteron.design import Candidate, Job, choose_machine
from pteron.kernels import Array
from pteron.motion import read_motors
from pteron.parts.drives import GEARBOXES, MOTORS, read_gearboxes

_POSES = 200 if quick() else 5000
_EVALUATIONS = 60 if quick() else 300

_MATERIALS = {
    "steel": (210e9, 7850.0),
    "aluminium": (70e9, 2700.0),
    "carbon": (120e9, 1600.0),
}
"""Young's modulus, Pa, and density, kg/m^3."""


def task(sides: list[float], mass: float, duration: float, **more: Any) -> dict[str, Any]:
    """Return a task: a line there and back through a box, with a payload."""
    points = [[-0.4 * sides[0], 0.0, 0.0], [0.4 * sides[0], 0.0, 0.0]]
    return {
        "workspace": {"size": sides},
        "payload": {"mass": mass},
        "cycles": [{"points": points, "duration": duration, "back": True}],
        "kinds": ["delta", "linear-delta"],
        "search": {"evaluations": _EVALUATIONS},
        **more,
    }


_SMALL = [0.3, 0.3, 0.1]
_POST = {"low": [0.6, -0.1, -2.0], "high": [0.8, 0.1, 2.0]}
TASKS: dict[str, dict[str, Any]] = {
    "small and fast": task([0.12, 0.12, 0.05], 0.05, 0.25),
    "pick and place": task([0.4, 0.4, 0.15], 0.5, 0.5),
    "larger": task([0.8, 0.8, 0.25], 1.0, 1.0),
    "large and slow": task([1.5, 1.0, 0.4], 10.0, 8.0),
    "heavy": task([0.5, 0.5, 0.2], 20.0, 3.0),
    "light": task(_SMALL, 0.01, 0.4),
    "flat": task([0.6, 0.6, 0.03], 0.5, 0.8),
    "tall": task([0.2, 0.2, 0.4], 0.5, 0.8),
    "long": task([1.2, 0.2, 0.1], 2.0, 2.0),
    "milling": task(_SMALL, 2.0, 3.0, process={"force": 100.0}),
    "pushing": task([0.2, 0.2, 0.1], 0.5, 2.0, process={"force": 400.0}),
    "on a wall": task(_SMALL, 1.0, 0.8, gravity=[0.0, -9.81, 0.0]),
    "upside down": task(_SMALL, 1.0, 0.8, gravity=[0.0, 0.0, 9.81]),
    "oblique": task(_SMALL, 1.0, 0.8, gravity=[5.0, 3.0, -7.0]),
    "accurate": task(_SMALL, 0.5, 0.8, accuracy={"most": 1e-4}),
    "stiff": task(_SMALL, 0.5, 0.8, stiffness={"force": 50.0, "most": 2e-4}),
    "in any direction": task(_SMALL, 0.5, 0.8, motion={"speed": 1.0, "acceleration": 15.0}),
    "low": task(_SMALL, 0.5, 0.8, cell={"height": 1.0}),
    "beside a post": task(_SMALL, 0.5, 0.8, keep_out=[_POST]),
    "least energy": task(_SMALL, 0.5, 0.8, objectives=["energy"]),
}


def main() -> None:
    """Print for each task and machine the worst values over those stated."""
    worst: dict[str, float] = {}
    for name, given in list(TASKS.items())[: 2 if quick() else None]:
        job = Job.model_validate(given)
        for candidate in choose_machine(job, workers=1 if quick() else 2).candidates:
            if not candidate.serves:
                print(f"{name}: {candidate.summary()}")
                continue
            shares = compared(job, candidate)
            worst |= {limit: max(share, worst.get(limit, 0.0)) for limit, share in shares.items()}
            text = ", ".join(f"{limit} {share:.4f}" for limit, share in shares.items())
            print(f"{name}: {candidate.kind}: {text}", flush=True)
    text = ", ".join(f"{limit} {share:.4f}" for limit, share in worst.items())
    print(f"Worst value found over the one that is stated: {text}")


def compared(job: Job, candidate: Candidate) -> dict[str, float]:
    """Return for each limit the worst value at random poses over the value that is stated."""
    machine = OwnMachine(job, candidate)
    rng = np.random.default_rng(0)
    half, middle = job.workspace.half, np.array(candidate.middle)
    corners = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
    poses = middle + half * np.vstack([rng.uniform(-1.0, 1.0, (_POSES, 3)), corners])
    values = [machine.limits(pose) for pose in poses]
    shares = {}
    for row in candidate.limits:
        if row.name in values[0]:
            found = np.array([each[row.name] for each in values])
            shares[row.name] = float(
                found.max() / row.value if row.upper else row.value / found.min()
            )
    return shares


class _Leg(NamedTuple):
    """A leg at a pose: what its joint and its crank do."""

    rod: Array
    rate: Array
    """Of the rod's first end by the joint coordinate."""
    crank: Array
    """From its axis to the rod; zero of a slider."""


class OwnMachine:
    """A Delta or linear Delta from the numbers of its file, with statics and beams of its own."""

    def __init__(self, job: Job, candidate: Candidate) -> None:
        file = tomllib.loads(candidate.robot)
        self.legs, self.gravity = file["legs"], np.array(file["gravity"])
        self.platform = float(file["platform"]["mass"]) + job.payload.mass
        self.force = 0.0 if job.process is None else job.process.force
        self.rods, self.cranks = (_tube(candidate.stocks.get(k)) for k in ("lower", "upper"))
        motor, gear = candidate.drives[0].split(" + ")
        found = next(each for each in read_gearboxes(GEARBOXES) if each.name == gear)
        shaft = next(m.stiffness for m in read_motors(MOTORS) if m.name == motor)
        self.stiffness = 1.0 / (1.0 / found.stiffness + 1.0 / (shaft * found.ratio**2))

    def limits(self, pose: Array) -> dict[str, float]:
        """Return the values of the limits that are computed here, at a pose."""
        legs = [self._at(leg, pose) for leg in self.legs]
        rows = np.array([leg.rod / (leg.rod @ leg.rate) for leg in legs])
        units = np.array([leg.rod / np.linalg.norm(leg.rod) for leg in legs])
        carried, own = self.platform * self.gravity, []
        for data, leg in zip(self.legs, legs, strict=True):
            mass = data["lower"]["mass"]
            share = -np.ravel(data["lower"]["first_moment"])[0] / mass / data["lower_length"]
            carried = carried + (1.0 - share) * mass * self.gravity
            at_elbow = share * mass * self.gravity
            own.append((at_elbow + self._joint_weight(data, leg)) @ leg.rate)
        drives = -np.linalg.solve(rows.T, carried) - own
        process = self.force * np.linalg.norm(np.linalg.inv(rows), axis=0)
        rated = np.array([d["drive"]["rated_torque"] * d["drive"]["ratio"] for d in self.legs])
        tensions = np.linalg.solve(units.T, carried)
        pushed = tensions - self.force * np.linalg.norm(np.linalg.inv(units.T), axis=1)
        length = np.array([data["lower_length"] for data in self.legs])
        euler = pi**2 * self.rods.rigidity / length**2
        frequency = 0.5 * pi / length**2 * sqrt(self.rods.rigidity / self.rods.line_mass)
        return {
            "holding torque / rated": float(((np.abs(drives) + process) / rated).max()),
            "sag by weights": float(np.linalg.norm(self._sag(legs, rows, units, tensions, drives))),
            "buckling load / force": float((euler / np.maximum(-pushed / 2.0, 1e-9)).min()),
            "first frequency": float(frequency.min()),
        }

    def _sag(
        self, legs: list[_Leg], rows: Array, units: Array, tensions: Array, drives: Array
    ) -> Array:
        """Return the tool's displacement at rest (3,), m: rods, cranks and drives give way."""
        # Actuator forces and tensions of unit forces on the tool, a column each.
        by_unit = np.linalg.solve(units.T, np.eye(3))
        drive_by_unit = -np.linalg.solve(rows.T, np.eye(3))
        moved = by_unit.T @ (tensions * np.array([g["lower_length"] for g in self.legs]))
        moved = moved / (2.0 * self.rods.axial) + drive_by_unit.T @ (drives / self.stiffness)
        for k, leg in enumerate(legs):
            a = float(np.linalg.norm(leg.crank))
            if not a:
                continue
            along = leg.crank / a
            weight = self.legs[k]["upper"]["mass"] * self.gravity / a
            lower = self.legs[k]["lower"]
            share = -np.ravel(lower["first_moment"])[0] / self.legs[k]["lower_length"]
            tip = tensions[k] * units[k] + share * self.gravity
            unit_tips = np.outer(units[k], by_unit[k])
            across = np.eye(3) - np.outer(along, along)
            bent = across @ tip * a**3 / 3.0 + across @ weight * a**4 / 8.0
            moved = moved + unit_tips.T @ bent / self.cranks.rigidity
            pulled = along * (tip @ along * a + weight @ along * a**2 / 2.0)
            moved = moved + unit_tips.T @ pulled / self.cranks.axial
        return np.asarray(moved)

    def _joint_weight(self, data: dict[str, Any], leg: _Leg) -> Array:
        """Return the weight of slider or crank, as a force at the rod's first end."""
        if "slider" in data:
            return np.asarray(data["slider"]["mass"] * self.gravity)
        moment = np.ravel(data["upper"]["first_moment"])[0]
        return np.asarray(moment / np.linalg.norm(leg.crank) * self.gravity)

    def _at(self, data: dict[str, Any], pose: Array) -> _Leg:
        """Return a leg at a pose of the platform."""
        way = pose + np.array(data["platform_point"]) - np.array(data["guide_point"])
        if "slider" in data:
            axis = np.array(data["slider_direction"])
            along = way @ axis
            reach = sqrt(data["lower_length"] ** 2 - (way @ way - along**2))
            q = along - data.get("elbow", 1) * reach
            return _Leg(way - q * axis, axis, np.zeros(3))
        axis, a = np.array(data["direction"]), data["upper_length"]
        flat = way - (way @ axis) * axis
        right = 0.5 * (way @ way + a**2 - data["lower_length"] ** 2) / a
        x = flat / np.linalg.norm(flat)
        cosine = right / np.linalg.norm(flat)
        side = data.get("elbow", 1) * sqrt(1.0 - cosine**2)
        crank = a * (cosine * x + side * np.cross(axis, x))
        return _Leg(way - crank, np.cross(axis, crank), crank)


class _Tube(NamedTuple):
    """E I, E A and mass of a metre of one tube."""

    rigidity: float
    axial: float
    line_mass: float


def _tube(stock: str | None) -> _Tube:
    """Return the stiffnesses of a stock such as carbon-tube:20x1.5."""
    if stock is None:
        return _Tube(inf, inf, 1.0)
    material, size = stock.split("-tube:")
    outer, wall = (1e-3 * float(part) for part in size.split("x"))
    inner = outer - 2.0 * wall
    area = pi / 4.0 * (outer**2 - inner**2)
    young, density = _MATERIALS[material]
    return _Tube(young * pi / 64.0 * (outer**4 - inner**4), young * area, density * area)


if __name__ == "__main__":
    main()
