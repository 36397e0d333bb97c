"""Friction laws without a state."""
