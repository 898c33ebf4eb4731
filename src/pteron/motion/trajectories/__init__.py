"""Trajectories of the platform: paths, time laws, cycles, and checks that the machine can follow."""
