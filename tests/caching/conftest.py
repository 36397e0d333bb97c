"""Caches of one test's own."""

import pytest


@pytest.fixture
def registry(monkeypatch):
    """A registry for one test's own caches."""
    caches = {}
    monkeypatch.setattr("jaxbiped.caching._caches._CACHES", caches)
    return caches
