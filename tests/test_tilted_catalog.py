"""The machines of the catalog whose platforms tilt: clean files, homes that are level."""

import json

import numpy as np
import pytest
from mechanisms import TILTED, gated
from test_cli import run

import pteron
from pteron.workspace import home_pose, pose_margins

HOMES = {
    "ankle": [0.0, 0.0],
    "wrist": [0.0, 0.0, 0.0],
    "reachy-mini": [0.0, 0.0, 0.177, 0.0, 0.0, 0.0],
    "rubin-camera-hexapod": [0.0] * 6,
    "rubin-m2-hexapod": [0.0] * 6,
    "stewart": [0.0, 0.0, 2.0, 0.0, 0.0, 0.0],
}
"""Where drawings have them at home."""


@pytest.mark.parametrize("name", gated(TILTED, ("ankle",)))
def test_it_is_clean_and_level_at_home(name):
    robot = TILTED[name]
    done = run(f"check {name} --json")
    assert (done.exit_code, done.stderr) == (0, "")
    found = json.loads(done.stdout)
    assert found["doubts"] == []
    home = home_pose(robot)
    assert found["home_pose"] == home.tolist()
    assert not home[robot.platform.angular].any()
    np.testing.assert_allclose(home, HOMES.get(name, home), atol=1e-12)
    assert pose_margins(robot, home).least > 0.4
    turned = pteron.rotation_of(robot, home, form="tilt-torsion")
    np.testing.assert_allclose(turned, 0.0, atol=1e-12)
