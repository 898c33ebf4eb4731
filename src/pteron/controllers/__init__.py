"""Controllers: from the reference motion and the measured joints to the forces of the drives."""

from pteron.arguments import check_arguments
from pteron.controllers.adaptive import Adaptive
from pteron.controllers.computed_torque import ComputedTorque
from pteron.controllers.controller import Controller
from pteron.controllers.feed_forward_pd import FeedForwardPD
from pteron.controllers.joint_masses import joint_masses
from pteron.controllers.law import Law
from pteron.controllers.pd_gravity import PDGravity

CONTROLLERS: dict[str, Controller] = {
    usual.what: usual
    for usual in (
        *(PDGravity(), FeedForwardPD(), ComputedTorque()),
        *(Adaptive(), Adaptive(friction=True)),
    )
}
"""Controllers as they are by default, by the names of their laws."""

__all__ = [
    "CONTROLLERS",
    "Adaptive",
    "ComputedTorque",
    "Controller",
    "FeedForwardPD",
    "Law",
    "PDGravity",
    "joint_masses",
]
check_arguments(__name__)


def __dir__() -> list[str]:
    return sorted(__all__)
