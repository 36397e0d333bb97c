"""Friction laws by families.

- _coulomb: one coefficient or none: regularised at rest, viscous, frictionless.
- _stribeck: a fall from static to kinetic friction: the seed's law, with its peak, and with its
  corners rounded; exponential; and as Brown and McPhee have it.
- _bristles: friction with a state: Dahl and LuGre.
"""
