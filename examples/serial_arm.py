"""A robot of your own: a serial arm of six axes, with a regressor that Pinocchio computes.

The arm has the lengths and masses that Universal Robots gives for the UR10e. Any robot whose
regressor you can compute will do. Needs Pinocchio: pip install pin.
"""

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.signal import savgol_filter  # type: ignore[import-untyped]

from pteron.identification import estimate

Array = NDArray[np.float64]

# Denavit and Hartenberg: d (m), a (m), alpha (rad), and masses (kg)
D = [0.1807, 0.0, 0.0, 0.17415, 0.11985, 0.11655]
A = [0.0, -0.6127, -0.57155, 0.0, 0.0, 0.0]
ALPHA = [np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0]
MASS = [7.369, 13.051, 3.989, 2.1, 1.98, 0.615]

rng = np.random.default_rng(0)
arm, place = pin.Model(), pin.SE3.Identity()
for i in range(6):
    joint = arm.addJoint(i, pin.JointModelRZ(), place, f"joint{i + 1}")
    place = pin.SE3(pin.utils.rotate("x", ALPHA[i]), np.array([A[i], 0.0, D[i]]))
    center = 0.5 * place.translation + 0.02 * rng.normal(size=3)
    body = pin.Inertia.FromEllipsoid(MASS[i], *(0.06 + np.abs(place.translation)))
    arm.appendBodyToJoint(joint, pin.Inertia(MASS[i], center, body.inertia), pin.SE3.Identity())
data = arm.createData()

KINDS = ["m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz"]
NAMES = [f"{kind}{i}" for i in range(1, 7) for kind in KINDS]
NAMES += [f"{kind}{i}" for kind in ("Fc", "Fv") for i in range(1, 7)]
UNITS = ["kg", *["kg m"] * 3, *["kg m^2"] * 6] * 6 + ["N m"] * 6 + ["N m s"] * 6
TERMS = ["base"] * 60 + ["coulomb"] * 6 + ["viscous"] * 6

bodies = np.concatenate([arm.inertias[i].toDynamicParameters() for i in range(1, 7)])
TRUTH = np.r_[bodies, 6.0, 8.0, 5.0, 1.5, 1.2, 1.0, 12.0, 14.0, 9.0, 2.0, 1.5, 1.0]
RATE, NOISE = 500.0, np.array([1.5, 1.5, 1.0, 0.3, 0.3, 0.2])  # samples a second; N m


def regressor(q: Array, v: Array, a: Array) -> Array:
    """Return W (R, 6, 72): Pinocchio's columns, and those of friction."""
    rigid = np.array(
        [pin.computeJointTorqueRegressor(arm, data, *state) for state in zip(q, v, a, strict=True)]
    )
    rates = v[..., None] * np.eye(6)
    return np.concatenate([rigid, np.sign(rates), rates], axis=-1)


def recorded(seed: int) -> tuple[Array, Array]:
    """Return what sensors would have logged in 20 s: joint angles and torques."""
    draw = np.random.default_rng(seed)
    time = np.arange(round(20.0 * RATE)) / RATE
    angles = 2.0 * np.pi * 0.1 * np.arange(1, 9) * time[:, None]
    speeds = 2.0 * np.pi * 0.1 * np.arange(1, 9)
    c, s = 0.25 * draw.normal(size=(2, 8, 6))
    q = draw.uniform(-1.0, 1.0, 6) + np.cos(angles) @ c + np.sin(angles) @ s
    v = (speeds * np.cos(angles)) @ s - (speeds * np.sin(angles)) @ c
    a = -(speeds**2 * np.cos(angles)) @ c - (speeds**2 * np.sin(angles)) @ s
    torques = regressor(q, v, a) @ TRUTH + NOISE * draw.normal(size=q.shape)
    return q + 1e-5 * draw.normal(size=q.shape), torques


def prepared(q: Array, torques: Array, block: int = 20) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return W and F, both averaged over blocks of samples, and which equations count."""
    smooth = [savgol_filter(q, 51, 5, deriv=k, delta=1.0 / RATE, axis=0) for k in range(3)]
    inner = slice(100, -100)
    q, v, a = (part[inner] for part in smooth)
    moves = np.abs(v) > 0.02  # dry friction holds a joint at rest with any torque

    def averaged(x: Array) -> Array:
        return np.asarray(x.reshape(-1, block, *x.shape[1:]).mean(axis=1))

    return (
        averaged(regressor(q, v, a)),
        averaged(torques[inner]),
        averaged(moves.astype(float)) == 1.0,
    )


def main() -> None:
    """Identify the arm, and print what was found."""
    w, f, used = prepared(*recorded(1))
    fit = estimate(
        w, f, names=NAMES, units=UNITS, kinds=TERMS, used=used,
        held_out=prepared(*recorded(2)), reduce=True,
    )  # fmt: skip
    assert fit.reduced is not None  # it was asked for
    print(fit.verdict.grade)
    for reason in fit.verdict.reasons:
        print(" ", reason)
    kept, gap = len(fit.reduced.names), fit.reduced.gap
    print(f"{kept} of {len(NAMES)} columns are independent, gap {gap:.0e}")
    print(f"{len(fit.essential.names)} values are essential")
    truth = fit.reduced.values(TRUTH)
    print(f"\n{'value':8}{'identified':>12}{'+-95 %':>9}{'true':>9}  what it is")
    rows = zip(
        fit.reduced.names, fit.estimate.values, 1.96 * fit.estimate.deviations, truth,
        fit.reduced.expressions, strict=True,
    )  # fmt: skip
    for name, value, reach, true, expression in rows:
        print(f"{name:8}{value:12.4f}{reach:9.4f}{true:9.4f}  {expression[:60]}")
    low, high = fit.estimate.intervals()
    print(f"\n{((low <= truth) & (truth <= high)).mean():.0%} of the 95 % intervals hold the truth")
    print(f"the joint region holds it at p = {fit.estimate.p_value(truth):.2f}")


if __name__ == "__main__":
    main()
