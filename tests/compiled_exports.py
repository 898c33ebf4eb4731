"""FMUs and LinuxCNC's kinematics, compiled against stubs of their hosts."""

from __future__ import annotations

import ctypes
import re
import subprocess
from dataclasses import replace

import fmpy

import pteron
from pteron.export import (
    export_linuxcnc,
)


def driven(robot, **more):
    """Return a machine whose drives differ from leg to leg, with friction of every kind."""
    legs = [
        replace(
            leg,
            drive=pteron.legs.Drive(
                *(0.3 + 0.1 * i, 0.4 - 0.05 * i, 0.05 * i, 1e-5, 40.0 - 90.0 * (i % 2)),
                rest_speed=0.02,
                stribeck=pteron.legs.Stribeck(0.1, 0.05),
                **more,
            ),
        )
        for i, leg in enumerate(robot.legs)
    ]
    return replace(robot, legs=tuple(legs))


def started(path):
    """Return the start values of an FMU's variables by name."""
    description = fmpy.read_model_description(path)
    return {v.name: float(v.start) for v in description.modelVariables if v.start is not None}


def simulated(path, kind, stop, **values):
    """Return what fmpy simulates, and what the FMU says."""
    said = []
    result = fmpy.simulate_fmu(
        path,
        fmi_type=kind,
        stop_time=stop,
        output_interval=stop / 8,
        relative_tolerance=1e-10,
        start_values=values,
        logger=lambda *message: said.append(message[-1].decode()),
    )
    return result, said


KINDS = ["CoSimulation", "ModelExchange"]


STUBS = {
    "rtapi_math.h": "#include <math.h>\n",
    "kinematics.h": """
        typedef struct { double x, y, z; } PmCartesian;
        typedef struct EmcPose { PmCartesian tran; double a, b, c, u, v, w; } EmcPose;
        typedef enum {
            KINEMATICS_IDENTITY = 1, KINEMATICS_FORWARD_ONLY, KINEMATICS_INVERSE_ONLY,
            KINEMATICS_BOTH
        } KINEMATICS_TYPE;
        typedef unsigned long int KINEMATICS_FORWARD_FLAGS;
        typedef unsigned long int KINEMATICS_INVERSE_FLAGS;
        extern int kinematicsForward(const double *, struct EmcPose *,
            const KINEMATICS_FORWARD_FLAGS *, KINEMATICS_INVERSE_FLAGS *);
        extern int kinematicsInverse(const struct EmcPose *, double *,
            const KINEMATICS_INVERSE_FLAGS *, KINEMATICS_FORWARD_FLAGS *);
        extern KINEMATICS_TYPE kinematicsType(void);
        #define EXPORT_SYMBOL(x) extern int symbol_##x
        #define KINS_NOT_SWITCHABLE

        #include <stdarg.h>
        #include <stdio.h>
        #include <stdlib.h>
        #include <string.h>
        typedef volatile double hal_float_t;
        typedef volatile double hal_bit_t;
        typedef enum { HAL_IN = 16, HAL_OUT = 32 } hal_pin_dir_t;
        static struct { char name[48]; hal_float_t value; } PINS[64];
        static int pin_count, comp_id __attribute__((unused)) = 7;
        double *pin(const char *name) {
            for (int i = 0; i < pin_count; i++)
                if (strcmp(PINS[i].name, name) == 0) return (double *)&PINS[i].value;
            return 0;
        }
        __attribute__((unused, format(printf, 4, 5))) static int hal_pin_float_newf(
            hal_pin_dir_t way, hal_float_t **place, int id, const char *format, ...) {
            va_list rest;
            va_start(rest, format);
            vsnprintf(PINS[pin_count].name, sizeof PINS->name, format, rest);
            va_end(rest);
            *place = &PINS[pin_count++].value;
            return way && id == 7 ? 0 : -1;
        }
        #define hal_pin_bit_newf hal_pin_float_newf
        #define hal_malloc(size) malloc((size_t)(size))
        #define hal_set_unready(id) ((id) == 7 ? 0 : -1)
        #define hal_ready(id) ((void)(id))
    """,
}
"""What the component needs of LinuxCNC 2.9: of kinematics.h, emcpos.h, posemath.h, rtapi_math.h
and, for its pins, of hal.h."""


class EmcPose(ctypes.Structure):
    _fields_ = [(name, ctypes.c_double) for name in ("x", "y", "z", *"abcuvw")]


def kinematics(robot, folder):
    """Return LinuxCNC's forward and inverse kinematics of a machine, and its files by suffix."""
    files = {path.name.partition(".")[2]: path for path in export_linuxcnc(robot, folder)[:3]}
    source = files["comp"].read_text()
    assert source.isascii()
    head, _, code = source.partition("\n;;\n")
    assert re.search(rf"^component {files['comp'].stem} ", head, re.MULTILINE)
    (folder / "kins.c").write_text(code)
    for name, text in STUBS.items():
        (folder / name).write_text(text)
    flags = ["-std=gnu99", "-O0", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Werror"]
    subprocess.run(
        ["gcc", *flags, "-shared", "-fPIC", "-I.", "kins.c", "-o", "kins.so", "-lm"],
        cwd=folder,
        check=True,
    )
    return ctypes.CDLL(str(folder / "kins.so")), files
