"""Normal contact laws by families, as forces of the penetration δ and its rate δ̇.

- _hertz: K δⁿ.
- _ristow_schafer: K δⁿ + c δ δ̇, the seed's, and the same with its corners rounded.
- _viscoelastic: K δ + D δ̇ (Kelvin and Voigt), K δ^{3/2} + γ δ^{1/2} δ̇ (Kuwabara and Kono),
  K δ^{3/2} + γ δ^{1/4} δ̇ (Tsuji).
- _hunt_crossley: K δⁿ (1 + χ δ̇/v⁻), with eight formulas for χ.
"""
