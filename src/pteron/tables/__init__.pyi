from pteron.tables.csv_file import CsvFile as CsvFile
from pteron.tables.dialect import Dialect as Dialect, declaration as declaration
from pteron.tables.files import (
    ENDINGS as ENDINGS,
    STANDARD_INPUT as STANDARD_INPUT,
    check_output as check_output,
    open_table as open_table,
    read_table as read_table,
    table_bytes as table_bytes,
    whole_table as whole_table,
    write_table as write_table,
)
from pteron.tables.parquet_file import ParquetFile as ParquetFile
from pteron.tables.table import Table as Table, join_names as join_names
from pteron.tables.units import convert_to_si as convert_to_si
