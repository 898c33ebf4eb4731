"""A new kind of platform: three translations and two rotations, driven by five U-P-S legs.

A passive chain between base and platform, without mass, bears the moment about the third axis: R =
Rot(x, alpha) Rot(y, beta). The quasi-velocities are the pose's rates.
"""

from math import cos, pi, sin

import casadi as ca
import numpy as np

import pteron
from pteron.bodies.inertia import RodInertia, SpatialInertia
from pteron.bodies.motion import Expression, PointMotion
from pteron.legs import UPS
from pteron.platforms import Platform
from pteron.platforms.conformance import faults
from pteron.platforms.kinds import KINDS
from pteron.platforms.motion import PlatformMotion
from pteron.platforms.tilting import Tilting


class FiveAxis(Tilting):
    """The equations of the platform: c = p + Rot(x, alpha) Rot(y, beta) s."""

    motion_name = "five-axis"
    freedom_text = "translates in space and tilts about two axes (3T2R)"
    coordinates = ("x", "y", "z", "alpha", "beta")
    order = ("alpha", "beta")
    joints = coordinates
    on_legs_alone = False

    def axes_by_angle(self) -> dict[str, Expression]:
        """Return the axis (3, 1) that each angle turns it about at angles zero."""
        return {"alpha": self.frame[0], "beta": self.frame[1]}

    def change_to_platform_axes(self, pose: Expression) -> None:
        """Return None: vectors are in the base frame's axes."""

    def motion(
        self, pose: Expression, velocity: Expression, acceleration: Expression
    ) -> PlatformMotion:
        """Return the motion of the platform and of its points."""
        turned = self.pose_rotation(pose, velocity, acceleration)
        place = PointMotion(pose[:3], velocity[:3], acceleration[:3])
        return self.assemble_motion(place, turned, ca.diagcat(ca.SX.eye(3), turned.axes), None)


KINDS[FiveAxis.motion_name] = FiveAxis


def five_ups() -> pteron.Manipulator:
    """Return a machine of five U-P-S legs under the platform."""
    cylinder, piston = RodInertia(1.2, (0.3,), 0.1), RodInertia(0.8, (-0.2,), 0.05)
    legs = []
    for degrees, up in zip((0, 80, 140, 220, 290), (0.0, 0.05, -0.04, 0.06, -0.05), strict=True):
        angle = degrees * pi / 180
        base = (0.6 * cos(angle), 0.6 * sin(angle), 0.0)
        joint = (0.2 * cos(angle + 0.5), 0.2 * sin(angle + 0.5), up)
        legs.append(UPS(base, joint, cylinder, piston, (0.5, 1.0)))
    body = SpatialInertia(3.0, (0.0, 0.0, 0.1), (0.05, 0.0, 0.0, 0.05, 0.0, 0.08))
    return pteron.Manipulator("five-ups", Platform(FiveAxis.motion_name, body), tuple(legs))


def main() -> None:
    """Test the kind of platform, then compute joints and drive forces of a machine."""
    robot = five_ups()
    assert faults(robot.platform) == ()
    pose = np.array([0.02, -0.03, 0.7, 0.1, -0.15])
    print("pose", ", ".join(robot.platform.coordinates))
    print("joints", np.round(pteron.inverse_kinematics(robot, pose), 4), "m")
    zero = np.zeros(5)
    print("drive forces at rest", np.round(pteron.drive_forces(robot, pose, zero, zero), 1), "N")


if __name__ == "__main__":
    main()
