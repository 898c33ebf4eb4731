"""What `import pteron` brings, and what it leaves until it is used."""

import json
import subprocess
import sys

import pytest

import pteron

SURFACE = {
    "load",
    "save",
    "inverse_kinematics",
    "link_vectors",
    "direct_kinematics",
    "working_modes",
    "jacobian",
    "link_jacobians",
    "joint_rates",
    "inverse_dynamics",
    "forward_dynamics",
    "mass_matrix",
    "bias_forces",
    "gravity_forces",
    "kinetic_energy",
    "potential_energy",
    "parameter_names",
    "parameters",
    "with_parameters",
    "regressor",
    "base_parameters",
    "base_regressor",
    "compile",
    "PteronError",
    "ModelError",
    "UnreachablePose",
    "SingularPose",
    "DataError",
    "motion",
    "workspace",
    "plots",
}
"""The public names that the design promised and that the library has."""

HEAVY = ("sympy", "scipy", "polars", "matplotlib", "pydantic", "typer", "rich", "tomlkit")


def in_a_fresh_python(code):
    """Return what the code prints, from JSON."""
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


def test_the_import_leaves_heavy_packages_alone():
    modules = in_a_fresh_python("import sys, json, pteron; print(json.dumps(list(sys.modules)))")
    assert "pteron" in modules
    assert [name for name in HEAVY if name in modules] == []


def test_kinematics_and_dynamics_do_without_them_too():
    modules = in_a_fresh_python(
        "import sys, json, pteron\n"
        "from pteron import Leg, Manipulator, PlanarInertia, Platform\n"
        "body = PlanarInertia(1.0, (0.0, 0.0), 0.01)\n"
        "axes = (1, 0, 0), (0, 1, 0), (0, 0, 1)\n"
        "legs = [Leg(axes[i - 1], axes[i], (0, 0, 0), 0.7, 0.7, 1, body, body) for i in range(3)]\n"
        "robot = Manipulator('small', Platform('3T', body), tuple(legs))\n"
        "zero = [0.0, 0.0, 0.0]\n"
        "pteron.inverse_dynamics(robot, zero, zero, zero)\n"
        "pteron.direct_kinematics(robot, pteron.inverse_kinematics(robot, zero))\n"
        "print(json.dumps(list(sys.modules)))"
    )
    assert [name for name in HEAVY if name in modules] == []


def test_every_public_name_resolves():
    assert len(set(pteron.__all__)) == len(pteron.__all__)
    assert list(pteron.__all__) == sorted(pteron.__all__)
    for name in pteron.__all__:
        assert getattr(pteron, name) is not None


def test_no_name_of_the_design_is_missing():
    assert SURFACE - set(pteron.__all__) == set()


def test_every_public_function_says_what_it_does():
    for name in pteron.__all__:
        assert (getattr(pteron, name).__doc__ or "").strip(), name


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'pteron' has no attribute 'kinematic'"):
        pteron.kinematic  # noqa: B018


def test_star_imports_bring_the_public_names():
    code = (
        "import json\nbefore = set(globals())\nfrom pteron import *\n"
        "print(json.dumps(sorted(set(globals()) - before - {'before'})))"
    )
    assert in_a_fresh_python(code) == sorted(pteron.__all__)


def test_the_version_is_that_of_the_package():
    from importlib.metadata import version

    assert version("pteron") == pteron.__version__
