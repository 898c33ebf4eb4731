"""A tuned controller, simulated."""

from pteron.controllers import Controller, FeedForwardPD
from pteron.motion import Simulation, pick_and_place, simulate, tune

motion = pick_and_place("linear-delta")
law: Controller = FeedForwardPD(period=1e-3)
tuning = tune("linear-delta", motion, law)
run: Simulation = simulate("linear-delta", motion, tuning.controller)
error = abs(run.pose - run.reference.pose).max()
least: dict[str, float] = tuning.least
print(run.stopped, float(error) < 1e-3, least["gain"] >= 2.0)
