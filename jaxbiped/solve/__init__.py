"""Stiff solves with diffrax and with the lanes engine."""
