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
