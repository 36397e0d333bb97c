"""Simulation: from a scene and a start to a motion, by either engine."""
