"""Caching: what outlives a call, each with its bound, and what outlives a process."""

import time

IMPORT_BEGAN = time.perf_counter()
"""When the import of the package began, which imports this before anything slow."""
IMPORT_BEGAN_AT = time.time_ns()
"""The same as a date [ns since the epoch]."""
