"""Caching: what outlives a call, each with its bound, and what outlives a process."""
