"""From a log's samples to states of the machine, with noise kept out and nothing shifted in time.

Positions are smoothed and differentiated in slider space, where they were measured; poses,
velocities and accelerations of the platform follow from them by exact kinematics.
"""

from pteron.identification.signals.assembly import assembly_mode
from pteron.identification.signals.differences import central_differences
from pteron.identification.signals.fourier import FourierSeries, fitted_series
from pteron.identification.signals.lowpass import cutoff_of, smoothed
from pteron.identification.signals.noise import white_noise
from pteron.identification.signals.parallel import Decimation
from pteron.identification.signals.spline import spline_motion
from pteron.identification.signals.states import NoPose, States
from pteron.identification.signals.treatment import Processing, Treatment, treatment_of

__all__ = [
    "Decimation",
    "FourierSeries",
    "NoPose",
    "Processing",
    "States",
    "Treatment",
    "assembly_mode",
    "central_differences",
    "cutoff_of",
    "fitted_series",
    "smoothed",
    "spline_motion",
    "treatment_of",
    "white_noise",
]
