"""Logs: recorded motions of a machine, read from CSV and Parquet files and checked.

Nothing is repaired: what cannot be a motion of the machine is refused, with its row and column, and
what looks odd is stated as a finding. Samples that are spikes are left out, like those of a gap.
"""

from typing import TYPE_CHECKING

from pteron.public import publish as _publish

if TYPE_CHECKING:
    from pteron.identification.logs.description import (
        Description as Description,
        KnownPayload as KnownPayload,
        joint_symbols as joint_symbols,
    )
    from pteron.identification.logs.description_file import (
        find_description as find_description,
        read_description as read_description,
        write_description as write_description,
    )
    from pteron.identification.logs.log import (
        Finding as Finding,
        Log as Log,
        join_logs as join_logs,
    )
    from pteron.identification.logs.log_file import (
        LogFile as LogFile,
        open_log as open_log,
        read_log as read_log,
    )
    from pteron.identification.logs.writing import write_log as write_log

_publish(__name__)
