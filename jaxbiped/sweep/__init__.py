"""Sweeps: starts, labels, gaits over parameters, stores and executors."""
