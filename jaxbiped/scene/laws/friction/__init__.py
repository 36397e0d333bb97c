"""Friction laws by families.

- _coulomb: one coefficient or none: regularised at rest, viscous, frictionless.
- _stribeck: a fall from static to kinetic friction, exponential or as Brown and McPhee have it.
- _bengisu_akay: the seed's law, with its Stribeck peak, and the same with its corners rounded.
- _bristles: friction with a state: Dahl and LuGre.
"""
