"""Extremes: simulations at the ends of every parameter's range, held against a check."""
