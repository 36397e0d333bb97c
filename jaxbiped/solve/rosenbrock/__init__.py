"""Rosenbrock methods."""
