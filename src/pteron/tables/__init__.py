"""Tables in CSV and Parquet files: read in blocks, checked, written whole or not at all.

Messages count data rows from 1, as a person does, and name the line of the file too. The cells of a
CSV file are text until a number is asked for, so that columns which Pteron does not use are written
back as they came.
"""

from pteron.tables.csv_file import CsvFile
from pteron.tables.dialect import Dialect, declaration
from pteron.tables.files import (
    ENDINGS,
    STANDARD_INPUT,
    check_output,
    open_table,
    read_table,
    table_bytes,
    whole_table,
    write_table,
)
from pteron.tables.parquet_file import ParquetFile
from pteron.tables.table import Table, listed
from pteron.tables.units import in_si

__all__ = [
    "ENDINGS",
    "STANDARD_INPUT",
    "CsvFile",
    "Dialect",
    "ParquetFile",
    "Table",
    "check_output",
    "declaration",
    "in_si",
    "listed",
    "open_table",
    "read_table",
    "table_bytes",
    "whole_table",
    "write_table",
]


def __dir__() -> list[str]:
    return sorted(__all__)
