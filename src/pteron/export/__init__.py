"""Code for a controller: C99 and IEC 61131-3 Structured Text."""

from pteron.export.c import Real, export_c
from pteron.export.functions import FUNCTIONS
from pteron.export.structured_text import export_st

__all__ = ["FUNCTIONS", "Real", "export_c", "export_st"]
