"""States of the machine from a log's samples, with noise kept out and nothing shifted in time.

Positions are smoothed and differentiated in joint space, where they were measured; poses,
velocities and accelerations of the platform follow from them by exact kinematics.
"""

from typing import TYPE_CHECKING

from pteron.identification.signals.derivatives import (
    Derivatives,
    central_differences,
    spline_motion,
    uniform,
)
from pteron.identification.signals.filters import (
    Decimation,
    cutoff_of,
    position_noise,
    smoothed,
    white_noise,
)
from pteron.identification.signals.fourier import FittedSeries, fitted_series
from pteron.identification.signals.preprocessing import Preprocessing, Processing, preprocessing_of
from pteron.identification.signals.samples import samples
from pteron.identification.signals.states import States, start_pose
from pteron.renamed import former_names

__all__ = [
    "Decimation",
    "Derivatives",
    "FittedSeries",
    "Preprocessing",
    "Processing",
    "States",
    "central_differences",
    "cutoff_of",
    "fitted_series",
    "position_noise",
    "preprocessing_of",
    "samples",
    "smoothed",
    "spline_motion",
    "start_pose",
    "uniform",
    "white_noise",
]

if not TYPE_CHECKING:
    __getattr__ = former_names(__name__)


def __dir__() -> list[str]:
    return sorted(__all__)
