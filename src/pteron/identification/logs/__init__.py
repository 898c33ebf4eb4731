"""Logs: recorded motions of a machine, read from CSV and Parquet files and checked.

Data are not repaired. A log that cannot be a motion of the machine is refused, with row and column;
improbable features are reported as findings. Spikes are omitted, like the samples of a gap.
"""

from pteron.public import publish as _publish

_publish(__name__)
