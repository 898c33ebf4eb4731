"""A machine's exported C: its header's declarations, and what its functions return."""

import ctypes
import re
import shutil
import subprocess
from math import prod
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

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
