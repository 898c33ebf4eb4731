"""Bodies: three-vectors, inertia, inertial parameters, and a body in motion."""
