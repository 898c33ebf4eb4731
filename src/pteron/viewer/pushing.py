"""Forward dynamics of a machine whose platform a spring pulls, with drives off or controlled."""

from __future__ import annotations

import numpy as np

from pteron.controllers import ComputedTorque, Law, PDGravity
from pteron.dynamics import kinetic_energy, potential_energy
from pteron.kernels import Array
from pteron.kinematics import inverse_kinematics, joint_rates
from pteron.manipulator import Manipulator
from pteron.motion.simulation.plant import advance, drive_states
from pteron.motion.simulation.stable_steps import allowed_step
from pteron.viewer.boundary import is_allowed, stop_reason
from pteron.viewer.sliding import nearest_reachable_pose

_NO_PULL = 1e-6
"""Gravity along the platform's lengths, m/s^2, up to which the machine does not fall."""

_PERIOD = 4e-3
"""Time for which the forces of the spring and of a controller are held, s."""

DRIVES = {
    "soft springs (PD, gravity balanced)": PDGravity(_PERIOD, bandwidth=8.0),
    "stiff springs (PD, gravity balanced)": PDGravity(_PERIOD, bandwidth=40.0),
    "computed torque": ComputedTorque(_PERIOD, bandwidth=8.0),
    "off: no force": None,
}
"""Controllers of the drives during a pull, by their names on the page; the first is the default."""

_STEP = 5e-4
"""Longest step of the integration, s."""

_RATE = 9.0
"""Least rate of the spring with the machine's moving mass, where none is given, rad/s."""

_SAG = 0.1
"""Greatest sag of the spring under that mass, as a share of the machine's size."""

_DAMPING = 0.3
"""Damping of the spring, over the critical one for that mass."""


class Push:
    """A machine, with its payload, in motion from rest under a spring.

    Attributes
    ----------
    pose, velocity : array, shape (m,)
        m, rad and s.
    forces : array, shape (n,)
        Forces of the drives, N or N m.
    does : str
        The state of the drives, in words.
    stops : str
        The limit or obstacle that stopped the platform in the last span, in words; else empty.
    stiffness : float
        Stiffness of the spring, N/m.
    spring : (array, array) or None
        Its ends, m: on the platform, and where it is held.
    """

    def __init__(self, robot: Manipulator, pose: Array, drives: str) -> None:
        self._robot, zeros = robot, np.zeros_like(pose)
        self._law: Law | None = None
        if (controller := DRIVES[drives]) is not None:
            self._law = controller.law(robot)
        self._wanted = pose
        self._memory = np.empty(0) if self._law is None else self._law.memory(pose, zeros)
        self._begin(pose, zeros)
        self._step = allowed_step(robot, pose, _STEP, usual=True)
        bodies = [body for leg in robot.legs for body in leg.bodies.values()]
        self._mass = sum(body.values[0] for body in (*bodies, robot.platform.total_inertia))
        # All machines fall equally fast: under a small one the spring must be stiffer to lift it.
        sag = _SAG * max(leg.size for leg in robot.legs)
        pull = float(np.linalg.norm(robot.platform.directions @ np.array(robot.gravity)))
        rate = max(_RATE, np.sqrt(pull / sag))
        self.stiffness = round(float(rate**2 * self._mass), 1)
        self.forces, self.stops = np.zeros(robot.joint_count), ""
        off = f"Drives off: {'it falls' if pull > _NO_PULL else 'nothing holds it'}"
        self.does = off if self._law is None else "The drives hold its pose"
        self._arm: Array | None = None
        self._spring_end = np.zeros(3)
        self._move(_PERIOD)  # the first call compiles
        self._begin(pose, zeros)

    @property
    def spring(self) -> tuple[Array, Array] | None:
        """The spring's ends, m; None without a spring."""
        return None if self._arm is None else (self._grip()[0], self._spring_end)

    def pull(self, grip: Array, spring_end: Array) -> None:
        """Attach a loose spring at `grip` (3,), m, and set its free end (3,), m."""
        if self._arm is None:
            place, axes = self._robot.platform.placement(self.pose)
            self._arm = axes @ (grip - place)
        self._spring_end = spring_end

    def release(self) -> None:
        """Let the spring go."""
        self._arm = None

    def go(self, span: float) -> None:
        """Simulate a time span, s.

        At a limit the platform slides along it, and loses the speed towards it: it has no more
        energy than it would have had behind it.
        """
        self.stops, robot = "", self._robot
        for periods in range(max(1, round(span / _PERIOD)), 0, -1):
            last_pose, rates = self.pose, self.velocity
            self._control()
            succeeded = self._move(_PERIOD)
            if succeeded and is_allowed(robot, self.pose):
                continue
            # A limit is handled once for the rest of the span: a slide takes milliseconds.
            succeeded = succeeded and self._move((periods - 1) * _PERIOD)
            energy = self._energy(self.pose, self.velocity) if succeeded else np.nan
            if not np.isfinite(energy):
                energy = self._energy(last_pose, rates)
            target = self.pose if np.isfinite(self.pose).all() else last_pose
            last, beyond = nearest_reachable_pose(robot, last_pose, target)
            self.stops = stop_reason(robot, target if beyond is None else beyond)
            slide = (last - last_pose) / (periods * _PERIOD)
            resting = self._energy(last, 0.0 * slide)
            most, kinetic = max(energy - resting, 0.0), self._energy(last, slide) - resting
            self._begin(last, slide * np.sqrt(most / kinetic) if kinetic > most else slide)
            return

    def _begin(self, pose: Array, velocity: Array) -> None:
        """Set the machine's state, with transmissions deflected as in equilibrium."""
        self.pose, self.velocity = pose, velocity
        self._drives = drive_states(self._robot, pose, velocity)

    def _move(self, span: float) -> bool:
        """Integrate over a span, s, at constant forces; return whether that succeeded."""
        count = int(np.ceil(span / self._step - 1e-9))
        state, step = (self.pose, self.velocity), span / max(count, 1)
        stepping = self._robot, *state, self.forces, step, count, self._wrench()
        self.pose, self.velocity, self._drives, succeeded = advance(*stepping, drives=self._drives)
        return bool(succeeded)

    def _energy(self, pose: Array, velocity: Array) -> float:
        """Return the energy of bodies, rotors and spring in a state, J; NaN where undefined."""
        robot, stretch = self._robot, 0.0
        rates = joint_rates(robot, pose, velocity, on_failure="nan").actuated
        rotors = np.array([leg.drive.inertia if leg.drive else 0.0 for leg in robot.legs])
        if self._arm is not None:
            place, axes = robot.platform.placement(pose)
            stretch = float(np.linalg.norm(self._spring_end - place - self._arm @ axes))
        bodies = kinetic_energy(robot, pose, velocity, on_failure="nan")
        bodies = bodies + potential_energy(robot, pose, on_failure="nan")
        return float(bodies + 0.5 * rotors @ rates**2 + 0.5 * self.stiffness * stretch**2)

    def _control(self) -> None:
        """Update the drives' forces by the control law at the present state."""
        if self._law is None:
            return
        joints = inverse_kinematics(self._robot, self.pose)
        rates = joint_rates(self._robot, self.pose, self.velocity).actuated
        zeros = np.zeros_like(self.pose)
        forces, self._memory = self._law(self._wanted, zeros, zeros, joints, rates, self._memory)
        # At a singularity of type II the law has no forces: the last ones stay.
        self.forces = np.where(np.isfinite(forces), forces, self.forces)

    def _grip(self) -> tuple[Array, Array]:
        """Return the spring's point on the platform, and the arm from P to it, base frame, m."""
        place, axes = self._robot.platform.placement(self.pose)
        arm = np.zeros(3) if self._arm is None else self._arm @ axes
        return place + arm, arm

    def _wrench(self) -> Array:
        """Return the spring's wrench on the platform at P, in the platform's wrench components."""
        platform, force = self._robot.platform, np.zeros(3)
        grip, arm = self._grip()
        if self._arm is not None:
            ahead = self._robot.platform.placement(self.pose + 1e-6 * self.velocity)
            speed = (ahead[0] + self._arm @ ahead[1] - grip) / 1e-6
            damping = 2.0 * _DAMPING * np.sqrt(self.stiffness * self._mass)
            force = self.stiffness * (self._spring_end - grip) - damping * speed
        moment = np.cross(arm, force)
        return platform.wrench_of(force, moment)
