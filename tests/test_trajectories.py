"""Trajectories: smooth, through their poses, within every limit, and refused where impossible."""

from dataclasses import replace

import numpy as np
import pytest
from differences import along
from mechanisms import CATALOG, MECHANISMS, random_machine, states

import pteron
from pteron.motion import with_payload

MACHINES = {
    **MECHANISMS,
    **{name: CATALOG[name] for name in ("linear-delta", "par4", "five-bar", "3-rrr", "3-prr")},
    "sliding": random_machine(0, "PRSSI"),
}
TOOLS = (
    "quadrupteron",
    "delta",
    "par4",
    "five-bar",
    "3-rrr",
    "quadrupteron turned",
    "random PRR 0",
)


@pytest.mark.parametrize("name", TOOLS)
def test_a_payload_is_the_weight_and_the_inertia_of_a_point_at_the_tool(name):
    # Power: what the drives give more is what the point mass takes, d/dt of its energy.
    robot = MACHINES[name]
    robot = replace(robot, platform=replace(robot.platform, tool=(0.03, -0.02, 0.05)))
    pose, velocity, acceleration = states(robot, 20, seed=4)
    more = [
        pteron.inverse_dynamics(machine, pose, velocity, acceleration)
        for machine in (with_payload(robot, 1.7), robot)
    ]
    rates = pteron.joint_rates(robot, pose, velocity).actuated
    given = ((more[0] - more[1]) * rates).sum(axis=-1)

    def tool(times):
        poses = pose + times * velocity + 0.5 * times**2 * acceleration
        p, axes = robot.platform.at(poses)
        return p + robot.platform.tool @ axes

    step = 1e-3
    v = along(lambda t: np.array([tool(k) for k in t]), step)
    a = along(
        lambda t: np.array([along(lambda u, k=k: [tool(k + w) for w in u], step) for k in t]), step
    )
    taken = 1.7 * ((a - robot.gravity) * v).sum(axis=-1)
    np.testing.assert_allclose(given, taken, rtol=1e-6, atol=1e-6 * np.abs(taken).max())


def test_a_payload_that_is_none_or_impossible():
    robot = MACHINES["quadrupteron"]
    assert with_payload(robot, 0.0) == robot
    for wrong in (-1.0, np.nan, np.inf, "heavy", None):
        with pytest.raises(pteron.DataError, match=r"payload: .* kg or more"):
            with_payload(robot, wrong)
    slides = MACHINES["sliding"]
    assert with_payload(slides, 1.0).platform.inertia.mass == slides.platform.inertia.mass + 1.0
    askew = replace(slides, platform=replace(slides.platform, tool=(0.1, 0.0, 0.0)))
    with pytest.raises(pteron.ModelError, match=r"0\.1 m off the axis"):
        with_payload(askew, 1.0)
