"""Logs: recorded motions of a machine, read from CSV and Parquet files and checked.

Nothing is repaired: what cannot be a motion of the machine is refused, with its row and column, and
what looks odd is stated as a finding. Samples that are spikes are left out, like those of a gap.
"""

from pteron.identification.logs.description import Description, KnownPayload, joint_symbols
from pteron.identification.logs.description_file import (
    find_description,
    read_description,
    write_description,
)
from pteron.identification.logs.log import Finding, Log, joined
from pteron.identification.logs.log_file import LogFile, open_log, read_log, write_log

__all__ = [
    "Description",
    "Finding",
    "KnownPayload",
    "Log",
    "LogFile",
    "find_description",
    "joint_symbols",
    "joined",
    "open_log",
    "read_description",
    "read_log",
    "write_description",
    "write_log",
]


def __dir__() -> list[str]:
    return sorted(__all__)
