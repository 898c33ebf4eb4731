"""A hexapod's component for LinuxCNC beside LinuxCNC's own genhexkins: the same joints, and times.

    python benchmarks/genhexkins.py /usr/lib/linuxcnc/modules/genhexkins.so

Both are called as LinuxCNC's motion does, with offsets of the tool, among stand-ins of HAL.
"""

from __future__ import annotations

import ctypes
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from measuring import Array, quick

import pteron
from pteron.export import export_linuxcnc

HAL = r"""
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
static struct { char name[64]; double value; } pins[256];
static int count;
double *pin(const char *name) {
    for (int i = 0; i < count; i++) if (!strcmp(pins[i].name, name)) return &pins[i].value;
    return 0;
}
static int made(void **place) { *place = &pins[count++].value; return 0; }
#define PIN(F) int F(int way, void **place, int id, const char *format, ...) { \
    va_list rest; va_start(rest, format); vsnprintf(pins[count].name, 64, format, rest); \
    va_end(rest); return made(place); }
PIN(hal_pin_bit_newf) PIN(hal_pin_float_newf) PIN(hal_pin_u32_newf)
#define NAMED(F) int F(const char *name, int way, void **place, int id) { \
    strcpy(pins[count].name, name); return made(place); }
NAMED(hal_pin_bit_new) NAMED(hal_pin_s32_new)
int hal_init(const char *name) { return 7; }
int hal_exit(int id) { return 0; }
int hal_ready(int id) { return 0; }
int hal_set_unready(int id) { return 0; }
void *hal_malloc(long size) { return calloc(1, size); }
void rtapi_print(const char *format, ...) {}
void rtapi_print_msg(int level, const char *format, ...) {}
"""

OURS = r"""
#include <math.h>
typedef struct { double x, y, z; } PmCartesian;
typedef struct EmcPose { PmCartesian tran; double a, b, c, u, v, w; } EmcPose;
typedef enum { KINEMATICS_BOTH = 4 } KINEMATICS_TYPE;
typedef unsigned long KINEMATICS_FORWARD_FLAGS, KINEMATICS_INVERSE_FLAGS;
typedef volatile double hal_float_t, hal_bit_t;
enum { HAL_IN = 16, HAL_OUT = 32 };
int hal_pin_float_newf(int, hal_float_t **, int, const char *, ...);
int hal_pin_bit_newf(int, hal_bit_t **, int, const char *, ...);
int hal_set_unready(int);
int hal_ready(int);
void *hal_malloc(long);
static int comp_id = 7;
#define EXPORT_SYMBOL(x) extern int symbol_##x
#define KINS_NOT_SWITCHABLE
"""
"""Declarations that LinuxCNC's headers have."""


class EmcPose(ctypes.Structure):
    """A position of LinuxCNC, mm and degrees."""

    _fields_ = [(name, ctypes.c_double) for name in ("x", "y", "z", *"abcuvw")]

    def values(self) -> Array:
        """Return X, Y, Z, A, B and C."""
        return np.array([getattr(self, name) for name in "xyzabc"])


def main() -> None:
    """Print differences, failures and times."""
    given = [Path(word) for word in sys.argv[1:] if not word.startswith("-")]
    if not given:
        print("genhexkins: left out; name LinuxCNC 2.9's genhexkins.so")
        return
    robot, count = pteron.load("stewart"), 20 if quick() else 300
    with TemporaryDirectory() as folder:
        hal, ours, name = built(robot, Path(folder))
        theirs = ctypes.CDLL(str(given[0]))
        theirs.rtapi_app_main()
        compare(robot, hal, {name: ours, "genhexkins": theirs}, count)


def built(robot: pteron.Manipulator, folder: Path) -> tuple[Any, Any, str]:
    """Return HAL's stand-in and the machine's component, compiled, and its name."""
    component = export_linuxcnc(robot, folder)[0]
    code = component.read_text().partition("\n;;\n")[2]
    for header in ("<rtapi_math.h>", '"kinematics.h"'):
        code = code.replace(f"#include {header}\n", "")
    found = []
    for name, text in (("hal", HAL), ("kins", OURS + code)):
        (folder / f"{name}.c").write_text(text)
        command = ["gcc", "-std=gnu99", "-O2", "-w", "-shared", "-fPIC", f"{name}.c"]
        subprocess.run([*command, "-o", f"{name}.so", "-lm"], cwd=folder, check=True)
        found.append(ctypes.CDLL(str(folder / f"{name}.so"), mode=ctypes.RTLD_GLOBAL))
    hal, kins = found
    hal.pin.restype = ctypes.POINTER(ctypes.c_double)
    kins.kinematicsType()
    return hal, kins, component.stem


def compare(robot: pteron.Manipulator, hal: Any, both: dict[str, Any], count: int) -> None:
    """Print what inverse and forward kinematics of random poses give."""
    for k, leg in enumerate(robot.legs):
        for part, point in (("base", leg.guide_point), ("platform", leg.platform_point)):
            for axis, value in zip("xyz", point, strict=True):
                hal.pin(f"genhexkins.{part}.{k}.{axis}".encode())[0] = 1e3 * value
    rng = np.random.default_rng(0)
    level = np.array([0.0, 0.0, 2000.0, 0.0, 0.0, 0.0])
    apart, off = 0.0, dict.fromkeys(both, 0.0)
    failed, spent = dict.fromkeys(both, 0), dict.fromkeys(both, 0.0)
    for _ in range(count):
        offsets = rng.uniform(-100, 300, 2)
        for pin, value in zip(("tool-offset", "spindle-offset"), offsets, strict=True):
            for name in both:
                hal.pin(f"{name}.{pin}".encode())[0] = value
        pose = level + rng.uniform(-1, 1, 6) * [200, 200, 200, 15, 15, 15]
        near = pose + rng.uniform(-1, 1, 6)
        joints = {name: (ctypes.c_double * 16)() for name in both}
        for name, module in both.items():
            world = EmcPose(*pose)
            assert module.kinematicsInverse(ctypes.byref(world), joints[name], None, None) == 0
            world = EmcPose(*near)
            before = time.perf_counter()
            status = module.kinematicsForward(joints[name], ctypes.byref(world), None, None)
            spent[name] += time.perf_counter() - before
            failed[name] += status != 0
            if status == 0:
                off[name] = max(off[name], float(np.abs(world.values() - pose).max()))
        one, other = (np.array(found[:6]) for found in joints.values())
        apart = max(apart, float(np.abs(one - other).max()))
    print(f"{robot.name}, {count} poses within 200 mm and 15 degrees of level, tools of any length")
    print(f"inverse: {apart:.0e} mm apart")
    print("forward, from poses 1 mm and 1 degree off:")
    for name in both:
        took = 1e6 * spent[name] / count
        print(f"  {name:<14} {took:5.0f} us, off by {off[name]:.0e}, {failed[name]} failed")


if __name__ == "__main__":
    main()
