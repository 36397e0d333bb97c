"""When the import of this package began; imported before anything slow."""

import time

IMPORT_BEGAN = time.perf_counter()
