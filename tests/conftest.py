"""Compiled code of a test run is kept apart, and only asked for by the tests that are about it."""

import os
import tempfile

os.environ.setdefault("PTERON_CACHE", tempfile.mkdtemp(prefix="pteron-test-"))
os.environ.setdefault("PTERON_KERNELS", "vm")
