from pteron.identification.faults.fault import IsolatedFault as IsolatedFault
from pteron.identification.faults.isolation import (
    FaultIsolation as FaultIsolation,
    delay_of as delay_of,
    isolate_faults as isolate_faults,
)
