"""Run time: scheduling, buffers, threads and caches."""
