"""Stability margins of a machine under a controller, and gains chosen for stated ones."""

from typing import TYPE_CHECKING

from pteron.public import publish as _publish

if TYPE_CHECKING:
    from pteron.motion.tuning.linear_plant import (
        LinearPlant as LinearPlant,
        linearise as linearise,
    )
    from pteron.motion.tuning.margins import LoopMargins as LoopMargins
    from pteron.motion.tuning.sampled_loop import SampledLoop as SampledLoop
    from pteron.motion.tuning.trials import GainTrial as GainTrial, trial as trial, trials as trials
    from pteron.motion.tuning.tune import Required as Required, Tuning as Tuning, tune as tune

_publish(__name__)
