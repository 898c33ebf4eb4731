"""What `import pteron` brings, what it leaves until it is used, and which file may know what."""

import ast
import compileall
import importlib
import io
import json
import os
import pickle
import re
import shutil
import subprocess
import sys
import threading
import tokenize
from pathlib import Path

import pytest
from mechanisms import CLIENTS

import pteron
from pteron.kernels import numeric
from pteron.kernels.choice import SharedCode

SURFACE = {
    "load",
    "save",
    "inverse_kinematics",
    "direct_kinematics",
    "working_modes",
    "follow",
    "jacobian",
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
    "export_c",
    "export_st",
    "identification",
    "report",
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

HEAVY = (
    *("sympy", "scipy", "polars", "matplotlib", "pydantic", "typer", "rich", "tomlkit"),
    *("jaxtyping", "unittest.mock", "asyncio"),
)


READING = ("pteron.manipulator.tables", "pteron.bodies.tables", "jaxtyping", "asyncio")
"""What reads and checks a machine's file, and what comes with the type hints of arrays."""


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
        "from pteron import Manipulator\n"
        "from pteron.bodies import PlanarInertia\n"
        "from pteron.legs import Leg\n"
        "from pteron.platforms import Platform\n"
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


def loaded_by(words):
    """Return the modules that a command line has loaded when it ends."""
    return in_a_fresh_python(
        "import sys, json\n"
        "from contextlib import redirect_stdout, suppress\n"
        "from io import StringIO\n"
        "from pteron_command import main\n"
        f"sys.argv[1:] = {words.split()}\n"
        "with redirect_stdout(StringIO()), suppress(SystemExit):\n"
        "    main()\n"
        "print(json.dumps(list(sys.modules)))"
    )


@pytest.mark.parametrize(
    ("words", "unused"),
    [
        ("--version", ("numpy", "rich.console", "urllib.request")),
        ("catalog", ("scipy", "sympy", "polars", "urllib.request", *READING)),
        pytest.param(
            *("check delta", ("scipy.optimize", "sympy", "polars", "jinja2", "jaxtyping")),
            marks=CLIENTS,
        ),
        (
            "inverse quadrupteron 0.01 0.02 -0.03 0.1",
            ("scipy", "sympy", "polars", "rich.console", *READING),
        ),
        ("direct quadrupteron 0.03 0.02 0.01 0.02", ("scipy", "sympy", "polars", *READING)),
        ("forces quadrupteron --pose 0.01 0.02 -0.03 0.1", ("sympy", "polars", *READING)),
        *(
            pytest.param(words, (*unused, *READING), marks=CLIENTS)
            for words, *unused in (
                ("base quadrupteron", "sympy", "polars"),
                ("cycle quadrupteron", "scipy.optimize", "sympy", "polars", "jinja2"),
                ("export quadrupteron --c controller", "sympy", "polars"),
                ("report quadrupteron --out report", "scipy.optimize", "sympy"),
            )
        ),
    ],
)
def test_a_command_loads_what_it_uses(words, unused, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    loaded_by(words)  # what it keeps on disk is there the second time
    modules = loaded_by(words)
    assert [name for name in unused if name in modules] == []


def test_every_public_name_resolves():
    assert len(set(pteron.__all__)) == len(pteron.__all__)
    assert list(pteron.__all__) == sorted(pteron.__all__)
    assert len(pteron.__all__) <= 60  # what a person calls; the rest is in its package
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


@CLIENTS
def test_star_imports_bring_the_public_names():
    code = (
        "import json\nbefore = set(globals())\nfrom pteron import *\n"
        "print(json.dumps(sorted(set(globals()) - before - {'before'})))"
    )
    assert in_a_fresh_python(code) == sorted(pteron.__all__)


def test_the_version_is_that_of_the_package():
    from importlib.metadata import version

    assert version("pteron") == pteron.__version__


# The seam: above legs, closures and platforms no file knows a kind of leg.

PACKAGE = Path(pteron.__file__).parent
SEAM = ("bodies", "legs", "closures", "platforms")
KNOWLEDGE = {
    "a kind of leg": r"\b(PRRR|RSS|PSS|RRR|PRR|RUPU|P-R-R-R|R-S-S)\b",
    "lengths of links": r"\b(lu|ll|upper_length|lower_length)\b",
    "data of one kind": r"\b(slider_mass|slider_direction|zero_direction|plane_axis)\b"
    r"|\bleg\.(upper|lower|direction|e)\b",
    "an elbow": r"\b\w*elbow\w*\b",
    "a list of bodies": r"""(["'])(p?ul|pu|pl)\1|(["'])[pul]\3, ?(["'])[pul]\4""",
}
"""What is looked for in code; docstrings and comments may say what they like."""

ALLOWED = {
    ("renamed.py", "a kind of leg"): "names that stood in pteron itself",
    ("manipulator/files.py", "a kind of leg"): "the kind where a file names none",
    ("manipulator/variants.py", "an elbow"): "working modes",
    ("cli/", "an elbow"): "--elbows, the working mode; and a leg as JSON",
    ("export/printers/", "an elbow"): "where Klipper has it, in the message that refuses",
    ("export/printers/", "data of one kind"): "Klipper's cranks count from the level",
    ("identification/faults/assumptions.py", "an elbow"): "the working mode, in a message",
    ("report/", "an elbow"): "the working mode",
    ("viewer/", "an elbow"): "the working mode",
    ("workspace/mode_places.py", "an elbow"): "the working modes",
    ("workspace/modes.py", "an elbow"): "the working modes",
    ("workspace/orientations.py", "an elbow"): "the working modes",
    ("kinematics/direct.py", "an elbow"): "the working mode that a pose is in",
    ("kinematics/evaluate.py", "an elbow"): "the kind of a singularity, in its message",
    ("reduction/exact_regressor.py", "an elbow"): "the side that a leg says it closed on",
    ("reduction/exact_geometry.py", "data of one kind"): "a unit vector across another, in a field",
}
"""File or folder, and knowledge; and why."""


def code_of(path):
    """Return a file's code without docstrings and comments; of what is not Python, all of it."""
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".py":
        return text
    lines = text.splitlines()
    for node in ast.walk(ast.parse(text)):
        plain = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if plain and isinstance(node.value.value, str):
            for i in range(node.lineno - 1, node.end_lineno):
                lines[i] = ""
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT and lines[token.start[0] - 1]:
            lines[token.start[0] - 1] = lines[token.start[0] - 1][: token.start[1]]
    return "\n".join(lines)


def known():
    """Return each file above the seam, and what it knows of legs: the words found."""
    found = {}
    for path in sorted(PACKAGE.rglob("*")):
        name = path.relative_to(PACKAGE).as_posix()
        above = path.suffix in (".py", ".j2", ".js") and name.split("/")[0] not in SEAM
        text = path.read_text(encoding="utf-8") if above else ""
        if any(re.search(pattern, text) for pattern in KNOWLEDGE.values()):
            code = code_of(path)  # it takes a while
            for what, pattern in KNOWLEDGE.items():
                words = sorted({match[0] for match in re.finditer(pattern, code)})
                if words:
                    found[name, what] = words
    return found


def test_no_file_above_the_seam_knows_a_kind_of_leg():
    found = known()
    allowed = {
        (name, what): {place for place in ALLOWED if name.startswith(place[0]) and what == place[1]}
        for name, what in found
    }
    assert {place: found[place] for place in found if not allowed[place]} == {}
    assert set(ALLOWED) == set().union(*allowed.values()), "exceptions without a use"


def test_what_is_looked_for_is_found():
    knowing = code_of(PACKAGE / "legs" / "prrr.py")
    assert all(re.search(KNOWLEDGE[what], knowing) for what in list(KNOWLEDGE)[:4])
    assert re.search(KNOWLEDGE["a list of bodies"], 'LEG_BODIES = ("p", "u", "l")')
    assert "P-R-R-R legs" in (PACKAGE / "legs" / "prrr.py").read_text(encoding="utf-8")
    assert "P-R-R-R legs" not in knowing


def test_names_are_listed_where_they_are_completed():
    assert set(pteron.__all__) <= set(dir(pteron))
    assert not {"Any", "import_module", "annotations"} & set(dir(pteron))


# What builds on the package: pickles, applications without sources, forks, entry points.


def packages():
    """Yield the name of each package, and the path of its `__init__.py`."""
    root = Path(pteron.__file__).parent
    for path in sorted(root.rglob("__init__.py")):
        yield ".".join(("pteron", *path.parent.relative_to(root).parts)), path


def test_public_names_are_those_of_the_stub():
    seen = 0
    for name, path in packages():
        stub = path.with_suffix(".pyi")
        if not stub.is_file():
            continue
        tree = ast.parse(stub.read_text(encoding="utf-8"))
        lines = [line for line in tree.body if isinstance(line, ast.ImportFrom)]
        expected = {alias.asname or alias.name for line in lines for alias in line.names}
        assert expected <= set(importlib.import_module(name).__all__), name
        assert all(hasattr(importlib.import_module(name), public) for public in expected), name
        seen += 1
    assert seen > 15


def test_packages_are_pickled_by_their_names():
    """As by joblib and Dask, which pickle functions with the modules that they use."""
    for package in (pteron, pteron.motion):
        assert pickle.loads(pickle.dumps(package)) is package
    cloudpickle = pytest.importorskip("cloudpickle")
    scope = {"pteron": pteron}
    exec("def double(x):\n    return 2 * len(pteron.catalog()) * x", scope)
    scope["double"].__module__ = "__main__"
    assert pickle.loads(cloudpickle.dumps(scope["double"]))(1) == 2 * len(pteron.catalog())


@CLIENTS
def test_a_tree_without_sources_works(tmp_path):
    """As in an application that is shipped as bytecode."""
    tree = tmp_path / "pteron"
    shutil.copytree(
        Path(pteron.__file__).parent, tree, ignore=shutil.ignore_patterns("__pycache__")
    )
    assert compileall.compile_dir(tree, legacy=True, quiet=2)
    for source in tree.rglob("*.py"):
        source.unlink()
    script = (
        "import pteron\n"
        "assert pteron.__file__.endswith('.pyc')\n"
        "rest = [0.0, 0.0, 0.0]\n"
        "print(len(pteron.__all__), pteron.inverse_dynamics('delta', [0, 0, -1], rest, rest))"
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        env=environment,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(str(len(pteron.__all__)))


@CLIENTS
def test_an_application_of_pyinstaller_has_all_modules_and_files(tmp_path):
    """Its hook is the package's: modules that are imported lazily, catalog, templates, versions."""
    pytest.importorskip("PyInstaller")
    program = tmp_path / "app.py"
    program.write_text(
        "import sys, pteron\n"
        "rest = [0.0, 0.0, 0.0]\n"
        "print(pteron.inverse_dynamics('delta', [0, 0, -1], rest, rest))\n"
        "from pteron.cli.main import app\n"
        "app(['report', 'five-bar', '--out', sys.argv[1]])\n"
    )
    # Optional packages beside pteron's own, which make the application ten times as large.
    left_out = "mujoco pinocchio jax pydrake gymnasium zarr xarray distributed dask numba pandas"
    left_out += " codac sphinx IPython playwright pymoo clarabel hypothesis pytest sdformat"
    excluded = [word for name in left_out.split() for word in ("--exclude-module", name)]
    build = [sys.executable, "-m", "PyInstaller", "--log-level", "ERROR", "app.py", *excluded]
    subprocess.run(build, check=True, cwd=tmp_path, timeout=900)
    page = tmp_path / "page"
    done = subprocess.run(
        [tmp_path / "dist" / "app" / "app", page], capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("[18.04")
    assert (page / "report.html").stat().st_size > 100_000
    shutil.rmtree(tmp_path / "dist")  # 0.7 GB


def test_without_gymnasium_all_of_the_package_can_be_looked_at():
    script = (
        "import sys; sys.modules['gymnasium'] = None\n"
        "import inspect, pydoc, pteron\n"
        "from pteron import *\n"
        "assert not hasattr(pteron, 'environments')\n"
        "assert 'environments' not in dir(pteron)\n"
        "print(len(inspect.getmembers(pteron)), len(pydoc.render_doc(pteron)))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_fork_while_code_is_compiled_goes_on():
    """The child has no thread that would release what admits one compilation at a time."""
    script = (
        "import os, time, numpy as np, pteron\n"
        "from pteron.kernels import numeric\n"
        "robot = pteron.load('delta')\n"
        "kernel = numeric(robot, 'reach')\n"
        "kernel.tier.add_interpreter_time(1.0)\n"  # it compiles in the background
        "child = os.fork()\n"
        "if child == 0:\n"
        "    kernel.tier.fetch(at_any_cost=True)\n"
        "    os._exit(0 if kernel.is_compiled else 1)\n"
        "print(os.waitpid(child, 0)[1])\n"
    )
    environment = {k: v for k, v in os.environ.items() if k != "PTERON_KERNELS"}
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", script],
        capture_output=True,
        text=True,
        env=environment,
        timeout=60,
    )
    assert done.stdout.strip() == "0", done.stderr


def test_an_interrupt_while_a_compilation_begins_leaves_the_way_free(monkeypatch):
    monkeypatch.delenv("PTERON_KERNELS")
    code = numeric(pteron.load("five-bar"), "room").tier.code

    class Interrupted:
        """Code whose source is interrupted."""

        def is_cached(self):
            return False

        @property
        def source(self):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        SharedCode(Interrupted(), 0.1).add_interpreter_time(1.0)
    # Another function is compiled without waiting for ever.
    other = SharedCode(code, 0.1)
    worker = threading.Thread(target=other.fetch, kwargs={"at_any_cost": True}, daemon=True)
    worker.start()
    worker.join(60.0)
    assert not worker.is_alive()


def test_a_compiler_that_fails_costs_speed_alone(tmp_path):
    compiler = tmp_path / "cc"
    compiler.write_text("#!/bin/sh\nexit 1\n")
    compiler.chmod(0o755)
    script = (
        "import numpy as np, pteron\n"
        "from pteron.motion import simulate\n"
        "start = np.array([0.0, 0.0, -1.0]), np.zeros(3)\n"
        "print(simulate('delta', start=start, duration=0.01).pose[-1].tolist())"
    )
    poses = []
    for change in ({"CC": str(compiler), "PTERON_CACHE": str(tmp_path)}, {"PTERON_KERNELS": "vm"}):
        environment = {k: v for k, v in os.environ.items() if k != "PTERON_KERNELS"}
        done = subprocess.run(
            [sys.executable, "-c", script], capture_output=True, text=True, env=environment | change
        )
        assert done.returncode == 0, done.stderr
        poses.append(done.stdout)
    assert poses[0] == poses[1]
