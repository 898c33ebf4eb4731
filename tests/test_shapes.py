"""The shapes in the type hints of the public functions are those that come and go."""

import subprocess
import sys

from mechanisms import CLIENTS

SCRIPT = """
from jaxtyping import install_import_hook

packages = ("kinematics", "dynamics", "motion", "workspace", "reduction.reduced")
with install_import_hook([f"pteron.{name}" for name in packages], "beartype.beartype"):
    import pteron
    from pteron.kinematics import joint_accelerations, joint_screws, link_jacobians, link_vectors
    from pteron.motion import joint_points, pick_and_place
    from pteron.workspace import pose_margins

for name, middle in (("quadrupteron", [0, 0, 0, 0]), ("delta", [0, 0, -0.8])):
    robot = pteron.load(name)
    batch = pteron.random_poses(robot, 3)
    base = pteron.base_parameters(robot, "qr")
    for x in (batch, batch[0], batch[None]):
        v = 0.0 * x
        q = pteron.inverse_kinematics(robot, x)
        pteron.direct_kinematics(robot, q)
        for f in (
            *(pteron.jacobian, link_vectors, link_jacobians, joint_screws),
            *(pteron.mass_matrix, pteron.gravity_forces, pteron.potential_energy),
            *(pose_margins, joint_points),
        ):
            f(robot, x)
        for f in (
            *(pteron.kinematics.joint_rates, pteron.coriolis_matrix, pteron.bias_forces),
            pteron.kinetic_energy,
        ):
            f(robot, x, v)
        for f in (
            *(joint_accelerations, pteron.inverse_dynamics, pteron.forward_dynamics),
            pteron.regressor,
        ):
            f(robot, x, v, v)
        pteron.inverse_dynamics(robot, x, v, v, wrench=v)
        pteron.base_regressor(robot, base, x, v, v)
    pick_and_place(robot, middle, samples=5)
"""


@CLIENTS
def test_public_functions_take_and_return_the_shapes_that_they_say():
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
