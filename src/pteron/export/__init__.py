"""Code for a controller, C99 and IEC 61131-3 Structured Text, and models for other tools."""

from pteron.export.c import Real, export_c
from pteron.export.casadi_functions import casadi_functions, export_casadi
from pteron.export.fmu import export_fmu
from pteron.export.functions import FUNCTIONS
from pteron.export.klipper import export_klipper
from pteron.export.linuxcnc import export_linuxcnc
from pteron.export.structured_text import export_st

__all__ = [
    "FUNCTIONS",
    "Real",
    "casadi_functions",
    "export_c",
    "export_casadi",
    "export_fmu",
    "export_klipper",
    "export_linuxcnc",
    "export_st",
]
