"""Extreme cases: simulations at the ends of every parameter's range, held against a check.

The check is `reference`, which shares nothing with the package that is judged.
"""
