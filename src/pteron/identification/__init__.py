"""Identification of a machine's parameters from logs of its motion, with a verdict.

`identify` performs all steps. They can be used separately: `logs` reads files, `signals` converts
samples to states, `observations_of` stacks the regressor, `estimators` solve for the parameters,
`faults` finds faults from the residuals, `consistency` finds physically possible bodies, and
`excitation` plans motions to record. `estimate` accepts the regressor of any robot.
"""

from pteron.public import publish as _publish

_publish(__name__, checked=True)
