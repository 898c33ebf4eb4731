"""A machine's exported C: its header's declarations, and what its functions return."""

import ctypes
import json
import re
import shutil
import subprocess
from dataclasses import replace
from math import prod
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from mechanisms import CATALOG, with_elbows

import pteron

COMPILER = shutil.which("cc") or shutil.which("gcc")
_FUNCTION = re.compile(r"/\*((?:(?!\*/).)*?)\*/\nint (\w+)\((.*?)\);", re.DOTALL)
_ARGUMENT = re.compile(r"(?m)^ \* (in |out) *(\w+) \((.*?)(?:, by rows)?\):")
_KEPT = 16


def exported(name, state):
    """Return what a catalog machine's header declares, and what its functions return in a state.

    Of more than 16 numbers two sums with fixed weights stand for all.
    """
    with TemporaryDirectory() as folder:
        header, source, *_ = pteron.export_c(name, folder=folder)
        declared = header.read_text("utf-8")
        library = Path(folder) / "code.so"
        flags = ["-std=c99", "-O1", "-shared", "-fPIC", "-o", library]
        subprocess.run([COMPILER, *flags, source, "-lm"], check=True)
        loaded = ctypes.CDLL(str(library))
    given = _inputs(pteron.load(name), *np.array(state))
    signatures, returned = re.findall(r"(?m)^extern const .*;$", declared), {}
    for comment, function, arguments in _FUNCTION.findall(declared):
        if "set_payload" in function:
            continue  # it came later
        signatures.append(f"int {function}({' '.join(arguments.split())});")
        arrays, outputs = [], {}
        for way, port, shape in _ARGUMENT.findall(comment):
            if way == "out":
                outputs[port] = np.full([int(size) for size in shape.split(" x ")], 77.0)
            array = outputs[port] if way == "out" else np.ascontiguousarray(given[port], float)
            assert array.size == prod(int(size) for size in shape.split(" x ")), (function, port)
            arrays.append(array)
        status = getattr(loaded, function)(*(ctypes.c_void_p(a.ctypes.data) for a in arrays))
        returned[function] = {
            "status": status,
            **{port: _told(array.ravel()) for port, array in outputs.items()},
        }
    return {"signatures": signatures, "returned": returned}


def _inputs(robot, pose, velocity, acceleration):
    return {
        "pose": pose,
        "velocity": velocity,
        "acceleration": acceleration,
        "joints": pteron.inverse_kinematics(robot, pose),
        "forces": pteron.inverse_dynamics(robot, pose, velocity, acceleration),
        "parameters": pteron.parameters(robot),
        "base_parameters": pteron.base_parameters(robot).values(),
    }


def _told(values):
    if values.size <= _KEPT:
        return values.tolist()
    rows = np.arange(values.size)
    return [float(np.cos(rows) @ values), float(np.sin(rows) @ values)]


ROBOT, DELTA = CATALOG["quadrupteron"], CATALOG["delta"]


SLIDER = pteron.legs.Leg(
    guide_point=(0.1, 0.55, -0.5),
    direction=(1.0, 0.0, 0.0),
    slider_direction=(0.8, 0.0, 0.6),
    platform_point=(0.125, 0.0, 0.01),
    upper_length=0.5,
    lower_length=0.45,
    slider_mass=1.3,
    upper=pteron.bodies.PlanarInertia.of_body(1.1, (0.2, 0.01), 0.08),
    lower=pteron.bodies.PlanarInertia.of_body(0.9, (-0.21, -0.02), 0.07),
    elbow=-1,
)


def with_drives(robot):
    drive = pteron.legs.Drive(3.0, 2.0, 0.1, 2e-5, 50.0, stribeck=pteron.legs.Stribeck(1.0, 0.1))
    return replace(robot, legs=tuple(replace(leg, drive=drive) for leg in robot.legs))


ROBOTS = {
    "quadrupteron": ROBOT,
    "oblique": replace(with_elbows(CATALOG["tripteron-oblique"], "--+"), name="oblique"),
    "delta": DELTA,
    "mixed": replace(DELTA, name="mixed", legs=(SLIDER, *DELTA.legs[1:])),
    "par4": with_drives(CATALOG["par4"]),
    "five_bar": replace(CATALOG["five-bar"], name="five_bar"),
}


COMPILERS = {
    "gcc": ["gcc", "-std=c99"],
    "g++": ["g++", "-x", "c++"],
    "clang": ["clang", "-std=c99"],
}


WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror"]


def build(folder, sources, *flags, compiler="gcc", output="run"):
    # -O1 sees all that is warned of, in half the time of -O2.
    done = subprocess.run(
        [*COMPILERS[compiler], "-O1", *WARNINGS, *flags, *sources, "-o", output, "-lm"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[:2000]


def run(folder):
    done = subprocess.run([folder / "run"], cwd=folder, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout


def compiled(robot, functions, folder, **options):
    """Return a machine's functions, called with arrays, and the header; they end with `shape`."""
    files = pteron.export_c(robot, functions, folder, **options)
    code = f"lib{files[1].stem}.so"
    build(folder, [files[1].name], "-shared", "-fPIC", output=code)
    build(folder, [files[2].name, f"./{code}"])
    assert run(folder)[0] == 0
    loaded, prefix = ctypes.CDLL(str(folder / code)), files[1].stem

    dtype = np.float32 if options.get("real") == "float" else np.float64

    def call(function, *inputs, sizes):
        outputs = [np.full(size, 77.0, dtype) for size in sizes]
        arrays = [np.ascontiguousarray(value, dtype) for value in inputs]
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in (*arrays, *outputs)]
        status = getattr(loaded, f"{prefix}_{function}")(*pointers)
        return status, *outputs

    return call, files[0].read_text()


def stiff(robot, **more):
    """Return a machine whose drives differ from leg to leg."""
    legs = [
        replace(
            leg,
            drive=pteron.legs.Drive(
                2.0 + i, 3.0 - i, 0.2 * i, 1e-5, 80.0 - 150.0 * (i % 2), **more
            ),
        )
        for i, leg in enumerate(robot.legs)
    ]
    return replace(robot, legs=tuple(legs))


def identification_file(path, base, values, friction):
    """Write what matters of an identification.json."""
    known = {
        "names": base.names,
        "expressions": base.expressions(digits=12),
        "values": values.tolist(),
        "shared": sorted({p.legs for p in base.parameters if len(p.legs) > 1}),
    }
    keys = ("coulomb", "viscous", "offset", "inertia", "stribeck")
    data = {
        "verdict": {"grade": "usable with care"},
        "base_parameters": known,
        "drives": [dict(zip(keys, (*one, 0.0, None), strict=True)) for one in friction],
        "kinds": ["base"] * base.rank,
        "estimate": {"names": base.names},
        "expressions": base.expressions(),
    }
    path.write_text(json.dumps(data))
    return path
