"""
Machines of the catalog
=======================

``pteron.catalog()`` lists machines to begin with. ``draw`` takes one of them, or your own, and a
pose: the home pose if none is given.
"""

import pteron

quadrupteron = pteron.plots.draw(pteron.load("quadrupteron"))

# %%
# A Delta has cranks: the dotted arcs are where they may turn. Parallel rods keep the platform from
# tilting.
delta = pteron.plots.draw(pteron.load("delta"))

# %%
# The platform of a Par4 is articulated: its parts move against each other when it turns.
par4 = pteron.plots.draw(pteron.load("par4"))

# %%
# Planar machines are drawn in their plane, with scales.
planar = pteron.plots.draw(pteron.load("3-rrr"))
