"""The augmented Lagrangian formulation: the paper's "augmented"."""

from jaxbiped.constraints._penalised import AbstractAugmented


class Augmented(AbstractAugmented):
    """M q̈⁰ = Q, then (M + A JᵀJ) q̈ᵏ⁺¹ = M q̈ᵏ − A Jᵀ(J̇ q̇ + 2 ζ ω Φ̇ + ω² Φ), repeated.

    The iterations take off what the penalty alone leaves: each shrinks it by about 1/(A s), where
    s ≈ 1/m is an eigenvalue of J M⁻¹ Jᵀ. Their number is fixed, so that nothing depends on a test
    and derivatives are those of the same arithmetic: three leave nothing at the usual A.

    Source: the seed paper, section 4, "augmented"; Bayo, García de Jalón and Serna (1988).

    Attributes:
        A: penalty [kg].
        omega: ω, the frequency at which a violation decays [1/s].
        zeta: ζ, its damping [–].
        iterations: how often.

    Raises:
        ArgumentError: A not above 0, ω or ζ below 0, or fewer than one iteration.
    """
