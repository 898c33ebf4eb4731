"""Where the platform goes, and when: paths, time laws, cycles, and whether the machine can."""
