"""When the import of this package began; imported before anything slow."""

import time

IMPORT_BEGAN = time.perf_counter()
IMPORT_BEGAN_AT = time.time_ns()
"""The same as a date [ns since the epoch]."""
