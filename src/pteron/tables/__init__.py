"""Tables of poses, sliders and forces in CSV and Parquet files.

Rows are counted from 1 as data rows, as a person counts them, and messages name the line of the
file too. The cells of a CSV file are kept as text until a number is asked for, so that columns
which Pteron does not use are written back as they came.
"""

from pteron.tables.files import (
    ENDINGS,
    STANDARD_INPUT,
    check_output,
    read_table,
    write_table,
)
from pteron.tables.table import Table

__all__ = ["ENDINGS", "STANDARD_INPUT", "Table", "check_output", "read_table", "write_table"]
