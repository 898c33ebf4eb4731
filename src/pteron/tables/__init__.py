"""Tables in CSV and Parquet files: read in blocks, checked, written whole or not at all.

Messages count data rows from 1, as a person does, and name the line of the file too. The cells of a
CSV file are text until a number is asked for, so that columns which Pteron does not use are written
back as they came.
"""

from pteron.public import publish as _publish

_publish(__name__)
