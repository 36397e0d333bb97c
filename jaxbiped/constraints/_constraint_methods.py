"""Constraint methods by the paper's names."""

from jaxbiped._checks import check_choice
from jaxbiped.constraints._augmented import Augmented
from jaxbiped.constraints._baumgarte import Baumgarte
from jaxbiped.constraints._constraint_method import AbstractConstraintMethod
from jaxbiped.constraints._direct_correction import DirectCorrection
from jaxbiped.constraints._index1 import Index1
from jaxbiped.constraints._index1_augmented import Index1Augmented
from jaxbiped.constraints._penalty import Penalty
from jaxbiped.constraints._standard import Standard

CONSTRAINT_METHODS: dict[str, type[AbstractConstraintMethod]] = {
    "standard": Standard,
    "baumgarte": Baumgarte,
    "penalty": Penalty,
    "augmented": Augmented,
    "index1": Index1,
    "index1aug": Index1Augmented,
    "described": DirectCorrection,
}
"""Names of the methods, as the seed paper's section 4 has them."""


def method_named(method: str | AbstractConstraintMethod) -> AbstractConstraintMethod:
    """The method of that name with its usual constants, or the method itself where one is given.

    Raises:
        ArgumentError: an unknown name.
    """
    if isinstance(method, AbstractConstraintMethod):
        return method
    check_choice("method", method, CONSTRAINT_METHODS)
    return CONSTRAINT_METHODS[method]()


def name_of(method: AbstractConstraintMethod) -> str:
    """The paper's name of a method."""
    return next(name for name, kind in CONSTRAINT_METHODS.items() if type(method) is kind)
