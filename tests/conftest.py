"""Compiled code of a test run is kept apart, and only asked for by the tests that are about it."""

import os
import signal
import tempfile

os.environ.setdefault("PTERON_CACHE", tempfile.mkdtemp(prefix="pteron-test-"))
os.environ.setdefault("PTERON_KERNELS", "vm")

# What a shell starts in the background ignores Ctrl-C; the tests of interruption want it.
signal.signal(signal.SIGINT, signal.default_int_handler)
