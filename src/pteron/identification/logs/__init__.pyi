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
from pteron.identification.logs.findings import (
    Finding as Finding,
)
from pteron.identification.logs.log import (
    Log as Log,
    join_logs as join_logs,
)
from pteron.identification.logs.log_file import (
    LogFile as LogFile,
)
from pteron.identification.logs.log_reading import (
    open_log as open_log,
    read_log as read_log,
)
from pteron.identification.logs.writing import write_log as write_log
