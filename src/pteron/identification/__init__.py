"""From a recorded motion to the parameters of the machine that made it."""
