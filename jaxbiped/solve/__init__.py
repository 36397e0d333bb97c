"""Stiff solves through diffrax and by lanes."""
