"""Rigid bodies: their inertia, inertial parameters and motion, and vectors in space."""
