"""States of the machine from a log's samples, with noise kept out and nothing shifted in time.

Positions are smoothed and differentiated in joint space, where they were measured; poses,
velocities and accelerations of the platform follow from them by exact kinematics.
"""

from typing import TYPE_CHECKING

from pteron.public import publish as _publish

if TYPE_CHECKING:
    from pteron.identification.signals.derivatives import (
        Derivatives as Derivatives,
        central_differences as central_differences,
        spline_motion as spline_motion,
        uniform as uniform,
    )
    from pteron.identification.signals.filters import (
        Decimation as Decimation,
        cutoff_of as cutoff_of,
        lowpass as lowpass,
        position_noise as position_noise,
        white_noise as white_noise,
    )
    from pteron.identification.signals.fourier import (
        FittedSeries as FittedSeries,
        fitted_series as fitted_series,
    )
    from pteron.identification.signals.preprocessing import (
        Preprocessing as Preprocessing,
        Processing as Processing,
        preprocessing_for_log as preprocessing_for_log,
    )
    from pteron.identification.signals.samples import samples as samples
    from pteron.identification.signals.states import States as States, start_pose as start_pose

_publish(__name__)
