"""Everything about a machine in one page, and the tables of numbers that stand in it."""

from pteron.report.write import write_report

__all__ = ["write_report"]


def __dir__() -> list[str]:
    return sorted(__all__)
