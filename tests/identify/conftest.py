"""What tests of fits share."""

import pytest

import jaxbiped as jb
from tests.identify.test_fit_of_mechanisms import NEAR, TORSO


@pytest.fixture(scope="session")
def torso_gait():
    """The gait of a walker with a torso on a spring."""
    return jb.find_gait(TORSO, NEAR, parameters=(), radius_sensitivities=False)
