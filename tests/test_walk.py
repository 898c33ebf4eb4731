"""docs/from-log-to-controller.md: its commands run, in order, and its C is what the model says."""

import ctypes
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from console_blocks import run_page

import pteron
from pteron.kernels.c import compiler

ROOT = Path(__file__).parent.parent
NAME = "docs/from-log-to-controller.md"
PAGE = (ROOT / NAME).read_text(encoding="utf-8")


@pytest.mark.clients
def test_the_whole_way(tmp_path, monkeypatch):
    if compiler() is None:
        pytest.skip("no C compiler")
    monkeypatch.chdir(tmp_path)
    printed = run_page(NAME, tmp_path)
    assert len(printed) == 17
    assert printed["controller/test"] == "all functions agree with the library\n"
    verdicts = [text for line, text in printed.items() if line.startswith("pteron identify")]
    assert all(text.startswith("my delta: trustworthy") for text in verdicts)
    # Without noise nothing is accused, but what no log can show is said.
    simulated = verdicts[0].replace("\n", " ")
    assert "half a sample (0.5 ms) late" in simulated
    assert "cannot show a common factor of all forces" in simulated
    assert "stated errors of the values do not allow" not in simulated

    # The C of the page, against the model file: real bodies have the values of the page's list.
    (code,) = re.findall(r"(?s)```c\n(.*?)```", PAGE)
    Path("loop.c").write_text(code, encoding="utf-8")
    files = ["loop.c", "controller/my_delta.c", "-Icontroller", "-lm", "-o", "loop.so"]
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"]
    subprocess.run([*compiler(), *flags, *files], check=True)
    called = ctypes.CDLL("./loop.so").fed_forward
    robot = pteron.load("result/my_delta.toml")
    home = pteron.workspace.home_pose(robot)
    assert "Home pose: (0, 0, -1)" in printed["pteron check robot.toml"]
    np.testing.assert_array_equal(home, [0.0, 0.0, -1.0])
    cycle = pteron.motion.pick_and_place(robot, home, samples=51)
    state = cycle.pose, cycle.velocity, cycle.acceleration
    motion = (
        pteron.inverse_kinematics(robot, cycle.pose),
        pteron.kinematics.joint_rates(robot, *state[:2]).actuated,
        pteron.kinematics.joint_accelerations(robot, *state).actuated,
    )
    expected, found = pteron.drive_forces(robot, *state, smooth=True), np.empty(3)
    for k, row in enumerate(expected):
        inputs = [ctypes.c_void_p(np.ascontiguousarray(part[k]).ctypes.data) for part in motion]
        assert called(*inputs, ctypes.c_void_p(found.ctypes.data)) == 0
        np.testing.assert_allclose(found, row, rtol=0, atol=1e-6 * np.abs(expected).max())
