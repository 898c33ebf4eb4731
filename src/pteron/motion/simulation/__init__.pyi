from pteron.motion.simulation.exported import Exported as Exported
from pteron.motion.simulation.loop import ControlLaw as ControlLaw
from pteron.motion.simulation.machines import (
    Machines as Machines,
    machines_about as machines_about,
)
from pteron.motion.simulation.many import Batch as Batch, simulate_many as simulate_many
from pteron.motion.simulation.plant import advance as advance
from pteron.motion.simulation.sensors import Sensors as Sensors
from pteron.motion.simulation.simulate import Controls as Controls, simulate as simulate
from pteron.motion.simulation.simulation import Simulation as Simulation
from pteron.motion.simulation.stable_steps import longest_step as longest_step, modes as modes
