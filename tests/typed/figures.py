"""Two figures on one page."""

from io import BytesIO

from matplotlib.figure import Figure

import pteron
from pteron.motion import pick_and_place

page = Figure(figsize=(9.0, 4.0), layout="constrained")
left, right = page.add_subplot(1, 2, 1), page.add_subplot(1, 2, 2)
robot = pteron.load("five-bar")
cycle = pick_and_place(robot)
drawn: Figure = pteron.plots.draw(robot, along=cycle.pose, ax=left)
speeds = cycle.velocity
pteron.plots.trajectory_figure(cycle.time, cycle.pose, speeds, names=robot.coordinates, ax=right)
file = BytesIO()
page.savefig(file, format="png")
print(len(file.getvalue()) > 1000, drawn is not None)
