"""Trajectories of the platform: paths, time laws, cycles, and checks of them."""
