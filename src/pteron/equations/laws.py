"""Control laws: the drives' forces at one sample, and the memory for the next.

A law takes a `Sample` (`equations.control`): the desired motion, the measured joints, the errors
e = q_d - q and e' of the joints, and the desired state at the middle of the sampling period.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from pteron.bodies.motion import Expression
from pteron.equations.control import ADAPTED, Sample, estimates
from pteron.equations.drives import Drives, drive_forces, joint_motion
from pteron.equations.kinematics import platform_rates
from pteron.equations.machine import State
from pteron.equations.mixed import mixed_forces
from pteron.equations.virtual_work import rigid_forces, share_forces

Answer = tuple[Expression, dict[str, Expression]]
"""Forces of the drives (n, 1), and the parts of the law's memory by name."""


def pd_gravity(s: Sample) -> Answer:
    """Return drive forces K_p e + K_d e' plus gravity and offsets, and the measured pose."""
    pose = s.find_pose(s.joints)
    drive_loads = s.feedback + s.drives.offset
    return _forces(s, s.machine.state(pose), drive_loads), {"measured": pose}


def _forces(s: Sample, state: State, drive_loads: Expression) -> Expression:
    """Return the drive forces that move the bodies of a state, plus those of the drives."""
    return drive_loads + rigid_forces(s.machine, state, s.parameters, drive_loads=drive_loads)


def feed_forward_pd(s: Sample) -> Answer:
    """Return drive forces K_p e + K_d e' plus those of the desired motion, and next memory."""
    drive_loads = s.feedback + drive_forces(s.drives, *joint_motion(s.middle), smooth=True)
    return _forces(s, s.middle, drive_loads), {"acceleration": s.desired.acceleration}


def computed_torque(s: Sample) -> Answer:
    """Return drive forces for q'' = q''_d + K_p e + K_d e' (computed torque), and next memory.

    Friction is evaluated at the desired rates, since the measured rate of a resting joint changes
    its sign.
    """
    pose, (desired_rates, desired_accelerations) = s.middle_pose, joint_motion(s.middle)
    accelerations = desired_accelerations + s.feedback
    motion = platform_rates(s.machine, pose, s.middle_rates, accelerations)
    drive_loads = drive_forces(s.drives, desired_rates, accelerations, smooth=True)
    needed = _forces(s, s.machine.state(pose, *motion), drive_loads)
    return needed, {"measured": pose, "acceleration": s.desired.acceleration}


def adaptive(s: Sample) -> Answer:
    """Return drive forces and updated estimates of Slotine and Li's adaptive law.

    With the reference q'_r = q'_d + slope e, and z = q'_r - q' = e' + slope e,

        F = Y theta + K_d z,    theta' = Gamma Y^T z,    Gamma = L L^T,

    where Y theta are the forces of M x''_r + C(x, x') x'_r + g and of the drives at q'_r, q''_r. Y
    is never formed: Y theta is linear in theta, so that Y^T z is the derivative of z^T Y theta.

    The memory holds eta, of theta = theta_0 + L eta: eta' = L^T Y^T z, by one step of Euler's
    method a sample, after which eta is projected onto |eta| <= room. In these coordinates the
    projection moves eta no farther from the true values, if they are within.

    J.-J. E. Slotine, W. Li, "On the adaptive control of robot manipulators", The International
    Journal of Robotics Research 6 (1987) 49-59; their s is -z.
    """
    return _adaptive_law(s, estimates(s.gains, s.memory["learnt"]), s.drives)


def adaptive_drives(s: Sample) -> Answer:
    """Return forces and estimates as `adaptive`, friction and motor inertias estimated too.

    Dry and viscous friction are monotonic in the rate: evaluated at q'_r they dissipate z.
    """
    estimate = estimates(s.gains, s.memory["learnt"])
    drive = estimate[s.selection.shape[1] :]
    estimated_drives = Drives(*ca.vertsplit(drive, len(s.machine.legs)), *s.drives[len(ADAPTED) :])
    return _adaptive_law(s, estimate, estimated_drives)


def _adaptive_law(s: Sample, estimate: Expression, drives: Drives) -> Answer:
    """Return forces and memory of Slotine and Li's law for given parameters and drives."""
    slope, pose, learnt = s.gains["slope"], s.middle_pose, s.memory["learnt"]
    z = s.error_rate + slope * s.error
    rates, accelerations = joint_motion(s.middle)
    reference_rates, reference_accelerations = (
        rates + slope * s.error,
        accelerations + slope * s.error_rate,
    )
    parameters = ca.mtimes(s.selection, estimate[: s.selection.shape[1]])
    needed = mixed_forces(
        s.machine, pose, s.middle_rates, reference_rates, reference_accelerations, parameters
    )
    at_rates = reference_rates, reference_accelerations
    drive_loads = drive_forces(drives, *at_rates, smooth=True)
    updated = learnt + s.gains["period"] * ca.jtimes(needed + drive_loads, learnt, z, True)
    room = s.gains["room"]
    drive_loads += s.gains["derivative"] * z
    shared = share_forces(s.machine, s.machine.state(pose), needed, drive_loads)
    return shared + drive_loads, {
        "measured": pose,
        "acceleration": s.desired.acceleration,
        "learnt": updated * (room / ca.fmax(ca.norm_2(updated), room)),
    }


LAWS: dict[str, Callable[[Sample], Answer]] = {
    "pd_gravity": pd_gravity,
    "feed_forward_pd": feed_forward_pd,
    "computed_torque": computed_torque,
    "adaptive": adaptive,
    "adaptive_drives": adaptive_drives,
}
"""The laws by name."""
