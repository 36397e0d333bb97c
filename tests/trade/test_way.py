"""Ways of solving, against their names and settings."""

from jaxbiped.trade import Way


def test_a_way_is_named_apart_from_its_setting():
    tight, draft = (Way("rodas4", "lanes", s, r) for s, r in (("tight", 2e-9), ("draft", 1e-5)))
    assert tight.name == draft.name == "rodas4 by lanes"
