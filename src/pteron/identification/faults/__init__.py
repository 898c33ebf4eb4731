"""Fault isolation: faults of logs or machine that a fit's residuals show, and their effects."""

from typing import TYPE_CHECKING

from pteron.public import publish as _publish

if TYPE_CHECKING:
    from pteron.identification.faults.fault import IsolatedFault as IsolatedFault
    from pteron.identification.faults.isolation import (
        FaultIsolation as FaultIsolation,
        delay_of as delay_of,
        isolate_faults as isolate_faults,
    )

_publish(__name__)
