"""
Base parameters, and what they save
===================================

Of the 40 inertial parameters of a Quadrupteron 26 combinations are all that forces show. A
controller computes faster with these.
"""

import pteron
from pteron.reduction import model_forms

robot = pteron.load("quadrupteron")
base = pteron.base_parameters(robot)
units = [base.parameters[k].unit for k in base.kept]
values = pteron.plots.parameters_figure(base.names, base.values(), units=units)

# %%
# Operations (+ - * / sqrt sin cos) of the inverse dynamics in one state, by the form of the model
# and the parameters it is written in.
costs = {
    f"{form}, {parameters}": kernel.operations
    for (form, parameters), kernel in model_forms(base).items()
}
operations = pteron.plots.operations_figure(list(costs), list(costs.values()))
