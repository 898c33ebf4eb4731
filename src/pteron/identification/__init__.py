"""Identification of a machine's parameters from logs of its motion, with a verdict on their trust.

`identify` does all of it. Its parts can be used by themselves: `logs` reads, `signals` turns
samples into states, `observations_of` stacks the regressor, `estimators` solve, `faults` names what
residuals show, `consistency` finds real bodies, `excitation` makes the motions worth recording.
`estimate` takes a regressor of any robot.
"""

from pteron.public import publish as _publish

_publish(__name__, checked=True)
