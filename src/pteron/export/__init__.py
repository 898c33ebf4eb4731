"""Code for a controller: C99 and IEC 61131-3 Structured Text."""

from pteron.export.c import export_c
from pteron.export.functions import FUNCTIONS

__all__ = ["FUNCTIONS", "export_c"]
