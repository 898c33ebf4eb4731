"""Control laws: drive forces from a planned motion and the measured joint coordinates."""

from pteron.controllers.adaptive import Adaptive as Adaptive
from pteron.controllers.computed_torque import ComputedTorque as ComputedTorque
from pteron.controllers.controller import Controller as Controller
from pteron.controllers.custom import Custom as Custom
from pteron.controllers.feed_forward_pd import FeedForwardPD as FeedForwardPD
from pteron.controllers.gains_file import (
    gains_text as gains_text,
    read_gains as read_gains,
    write_gains as write_gains,
)
from pteron.controllers.joint_masses import joint_masses as joint_masses
from pteron.controllers.law import Law as Law
from pteron.controllers.pd_gravity import PDGravity as PDGravity
from pteron.public import publish as _publish

CONTROLLERS: dict[str, Controller] = {
    usual.law_name: usual
    for usual in (
        *(PDGravity(), FeedForwardPD(), ComputedTorque()),
        *(Adaptive(), Adaptive(friction=True)),
    )
}
"""The controllers with default gains, by the names of their laws."""

_publish(__name__, checked=True)
