"""The tables of mutations, against the package that they break: each place is there, once."""

import ast

import pytest

from tests.mutants.mutations import ROOT, TIERS, mutations

EVERY = mutations()
PACKAGES = sorted(each.parent.name for each in (ROOT / "jaxbiped").glob("*/__init__.py"))


@pytest.mark.parametrize("name", EVERY)
def test_a_mutation_applies_and_is_python(name):
    mutation = EVERY[name]
    source = (ROOT / "jaxbiped" / mutation.file).read_text()
    mutated = mutation.mutated(source)
    assert ast.dump(ast.parse(mutated)) != ast.dump(ast.parse(source)), "nothing is broken"
    assert mutation.tier in TIERS
    assert mutation.breaks.endswith(".")
    for path in mutation.tests:
        assert (ROOT / path).exists(), path


def test_every_package_is_broken_somewhere():
    broken = {mutation.file.split("/")[0] for mutation in EVERY.values()}
    assert set(PACKAGES) <= broken


def test_a_place_that_moved_is_told():
    mutation = next(iter(EVERY.values()))
    with pytest.raises(ValueError, match="holds its text 0 times, not once"):
        mutation.mutated("")
