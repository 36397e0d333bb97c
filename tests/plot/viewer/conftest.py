"""One browser for all tests of the viewer."""

import pytest

from tests.browser import chromium


@pytest.fixture(scope="session")
def browser():
    with chromium() as page:
        yield page
