"""Base inertial parameters three ways, in numbers and in symbols of the geometry."""

from dataclasses import replace

import pteron

robot = pteron.load("quadrupteron")
for method in ("exact", "svd", "qr"):
    base = pteron.base_parameters(robot, method)
    print(f"{method}: rank {base.rank}")
    print("   ", base.certificate.summary().replace("\n", "\n    "))

exact = pteron.base_parameters(robot)
print("\nin numbers, and in symbols of the geometry", exact.geometry_values)
for number, symbol in zip(exact.expressions(), exact.expressions(symbols=True), strict=True):
    print(f"    {number:<78} {symbol}")

print("\nwhat gravity and sharing change:")
for label, machine, shared in (
    ("gravity along leg 1, as in the paper", robot, False),
    ("gravity along no leg", replace(robot, gravity=(1.0, 2.0, -9.0)), False),
    ("no gravity", replace(robot, gravity=(0.0, 0.0, 0.0)), False),
    ("all legs built alike", robot, True),
):
    print(f"    {label:<40}", pteron.base_parameters(machine, shared=shared).rank)
