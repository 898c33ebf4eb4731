"""Stability margins of a machine under a controller, and gains chosen for stated ones."""

from typing import TYPE_CHECKING

from pteron.public import publish as _publish

if TYPE_CHECKING:
    from pteron.motion.tuning.linear_plant import (
        LinearPlant as LinearPlant,
        linearised as linearised,
    )
    from pteron.motion.tuning.margins import Margins as Margins
    from pteron.motion.tuning.sampled_loop import SampledLoop as SampledLoop
    from pteron.motion.tuning.trials import Trial as Trial, trial as trial, trials as trials
    from pteron.motion.tuning.tune import Required as Required, Tuning as Tuning, tune as tune

_publish(__name__)
