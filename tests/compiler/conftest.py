"""What tests of the compiler share."""

import pytest

from jaxbiped.compiler.runtime import _machine_code


@pytest.fixture(scope="module", autouse=True)
def _llvm_does_its_best():
    """Here, LLVM compiles as for users: what it makes of the code is part of what is tested."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(_machine_code, "EFFORT", 2)
        yield
