from pteron.identification.excitation.conditioning import (
    Conditioning as Conditioning,
    conditioning as conditioning,
    scaled_condition as scaled_condition,
    stacked_regressor as stacked_regressor,
)
from pteron.identification.excitation.excitation import Excitation as Excitation, Start as Start
from pteron.identification.excitation.fourier import FourierMotion as FourierMotion
from pteron.identification.excitation.held_out import (
    RepeatedCycle as RepeatedCycle,
    held_out_cycle as held_out_cycle,
)
from pteron.identification.excitation.layout import (
    MotionLayout as MotionLayout,
    check_sampling as check_sampling,
)
from pteron.identification.excitation.leads import (
    Lead as Lead,
    LedMotion as LedMotion,
    found_lead as found_lead,
)
from pteron.identification.excitation.limits import Limits as Limits
from pteron.identification.excitation.margins import (
    Margin as Margin,
    Margins as Margins,
    margins as margins,
)
from pteron.identification.excitation.motion_files import motion_paths as motion_paths
from pteron.identification.excitation.random_motions import (
    random_excitation as random_excitation,
)
from pteron.identification.excitation.search import optimal_excitation as optimal_excitation
