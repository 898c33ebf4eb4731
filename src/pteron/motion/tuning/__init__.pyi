from pteron.motion.tuning.linear_plant import (
    LinearPlant as LinearPlant,
    linearise as linearise,
)
from pteron.motion.tuning.margins import LoopMargins as LoopMargins
from pteron.motion.tuning.sampled_loop import SampledLoop as SampledLoop
from pteron.motion.tuning.trials import GainTrial as GainTrial, trial as trial, trials as trials
from pteron.motion.tuning.tune import Required as Required, Tuning as Tuning, tune as tune
