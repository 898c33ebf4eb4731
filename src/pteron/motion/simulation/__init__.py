"""A machine with its drives, simulated under a controller, under given forces, or free."""

from pteron.motion.simulation.loop import ControlLaw as ControlLaw
from pteron.motion.simulation.plant import advance as advance, longest_step as longest_step
from pteron.motion.simulation.sensors import Sensors as Sensors
from pteron.motion.simulation.simulate import Controls as Controls, simulate as simulate
from pteron.motion.simulation.simulation import Simulation as Simulation
from pteron.public import publish as _publish

_publish(__name__)
