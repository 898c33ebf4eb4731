"""Logs: recorded motions of a machine, read from CSV and Parquet files and checked.

Nothing is repaired: what cannot be a motion of the machine is refused, with its row and column, and
what looks odd is stated as a finding. Samples that are spikes are left out, like those of a gap.
"""

from pteron.public import publish as _publish

_publish(__name__)
