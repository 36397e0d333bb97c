"""Drawn mutations, against slips of small sources that are written out here."""

import ast
import textwrap
from collections import Counter

import pytest

from tests.mutants import equivalent
from tests.mutants.drawing import PACKAGE, apply, draw, sites
from tests.mutants.drawn_mutants import interval
from tests.mutants.executed_blocks import block_at, blocks, note_blocks
from tests.mutants.operators import slips

CASES = [
    ("sign", "y = a + b", {"a - b"}),
    ("sign", "y = -a", {"a"}),
    ("sign", "y += a", {"y -= a"}),
    ("term", "y = a - b * c", {"a", "-(b * c)"}),
    ("factor", "y = 2.0 * a", {"2.0", "a", "2.0 / a"}),
    ("factor", "y = a / b", {"a", "a * b"}),
    ("factor", "y = a**2", {"a"}),
    ("bound", "y = a < b <= c", {"a <= b <= c", "a < b < c"}),
    ("comparison", "y = a == b", {"a != b"}),
    ("comparison", "y = a is None", {"a is not None"}),
    ("and-or", "y = a and b", {"a or b"}),
    ("condition", "y = a and b and c", {"b and c", "a and c", "a and b"}),
    ("condition", "y = not a", {"a"}),
    ("condition", "if a:\n    b = c", {"if not a:\n    b = c"}),
    ("mask", "y = jnp.where(a, b, c)", {"b", "c"}),
    ("mask", "y = b if a else c", {"b", "c"}),
    ("mask", "y = a & b", {"a", "b", "a | b"}),
    ("mask", "y = ~a", {"a"}),
    ("min-max", "y = np.minimum(a, b)", {"np.maximum(a, b)"}),
    ("min-max", "y = any(a)", {"all(a)"}),
    ("function", "y = abs(a)", {"a"}),
    ("arguments", "y = f(a, b, c)", {"f(b, a, c)", "f(a, c, b)"}),
    ("default", "y = f(a, b=c, d=e)", {"f(a, d=e)", "f(a, b=c)"}),
    ("index", "y = a[-1]", {"a[0]", "a[-2]"}),
    ("index", "y = a[1:n]", {"a[:n]", "a[1:]"}),
    ("constant", "y = 3", {"4", "2"}),
    ("constant", "y = 0.5", {"1.0", "0.25"}),
    ("constant", "y = True", {"False"}),
    ("call", "check(a)\ny = b", {"pass"}),
    ("early-end", "if a:\n    raise b\ny = c", {"pass"}),
    ("key", "key = (a, b)", {"key = (b,)", "key = (a,)"}),
    ("key", "y = fingerprint(a, b)", {"fingerprint(b)", "fingerprint(a)"}),
    (
        "key",
        "class A:\n    x: int = eqx.field(static=True, default=b)\n    y: int",
        {"x: int = eqx.field(default=b)"},
    ),
    (
        "key",
        "def structure_of():\n    return (a, b)\n\ny = a",
        {"def structure_of():\n    return (b,)", "def structure_of():\n    return (a,)"},
    ),
]


def drawn_from(source):
    """All slips of a source that leave another program."""
    pairs = [(site, slip) for site in sites(source, "it.py") for slip in slips(site.node)]
    made = [apply(site, slip, source) for site, slip in pairs]
    return [drawn for drawn in made if drawn is not None]


@pytest.mark.parametrize(("kind", "source", "instead"), CASES)
def test_a_node_suffers_these_slips_of_a_kind(kind, source, instead):
    assert {d.instead for d in drawn_from(source) if d.kind == kind} == instead


SOURCE = textwrap.dedent(
    '''
    """It adds 3 and 4: a + b."""

    from typing import TYPE_CHECKING, overload

    if TYPE_CHECKING:
        A = 1 + 2
    Size: TypeAlias = dict[int, 3]


    class B:
        """It has 5 words."""

        x: Literal[6] = given(λ)
        """At least 7."""

        def __repr__(self):
            return 8 * "words"

        @cached(9)
        def f(self, a: Literal[10], b=c) -> Literal[11]:
            # Of 12.
            assert a > 13
            if a:
                raise ValueError("below " + str(14))
            print(f"{15:.3g}")
            return (
                g(a)  # Before it: λ.
                + 16
            )
    '''
)


def test_words_types_and_comments_are_left_alone():
    """Of all the numbers one is computed with; texts of errors are no numbers."""
    made = drawn_from(SOURCE)
    assert {d.stands for d in made if d.kind == "constant"} == {"16"}
    assert {(d.within, d.kind) for d in made} >= {("B.f", "sign"), ("B.f", "condition")}
    assert {d.statement for d in made if d.kind == "sign"} == {"return g(a) + 16"}


def test_every_mutation_is_python_and_changes_one_place():
    for drawn in drawn_from(SOURCE):
        mutated = drawn.mutated(SOURCE)
        assert ast.dump(ast.parse(mutated)) != ast.dump(ast.parse(SOURCE))
        length = len(SOURCE.encode()) - (drawn.end - drawn.start) + len(drawn.text.encode())
        assert len(mutated.encode()) == length
        assert mutated.encode()[: drawn.start] == SOURCE.encode()[: drawn.start]


@pytest.fixture
def package(tmp_path):
    (tmp_path / "one.py").write_text("def f(a, b):\n    return a + b[0]\n")
    (tmp_path / "two.py").write_text(
        "\n".join(f"def f{k}(a):\n    return {k} - a[1] if a else g(a, {k})" for k in range(20))
    )
    return tmp_path


def test_a_draw_is_that_of_its_seed(package):
    assert draw(9, 3, package) == draw(9, 3, package)
    assert draw(9, 3, package) == draw(30, 3, package)[:9]
    assert draw(9, 3, package) != draw(9, 4, package)
    places = [drawn.place for drawn in draw(1000, 3, package)]
    assert len(places) == len(set(places))


@pytest.mark.nightly
def test_sites_are_drawn_alike_wherever_they_are(package):
    """Not by files: the file with a few sites has its share of them."""
    sources = {path.name: path.read_text() for path in package.iterdir()}
    many = {name: len(sites(source, name)) for name, source in sources.items()}
    times = Counter(draw(1, seed, package)[0].file for seed in range(400))
    share = many["one.py"] / sum(many.values())
    assert 0.0 < share < 0.05
    assert times["one.py"] / 400 == pytest.approx(share, abs=0.03)


def test_a_mutation_is_known_again_where_lines_moved(package):
    before = draw(1000, 3, package)
    for path in package.iterdir():
        path.write_text(f'"""It moved."""\n\n# By\n# lines.\n{path.read_text()}')
    assert {d.place for d in draw(1000, 3, package)} == {d.place for d in before}


def test_like_places_of_a_statement_differ(tmp_path):
    (tmp_path / "it.py").write_text("y = f(a[0], b[0])\n")
    made = {(drawn.nth, drawn.start) for drawn in draw(9, 0, tmp_path) if drawn.stands == "0"}
    assert made == {(0, 8), (1, 14)}


def test_the_table_of_equivalents_is_of_the_package():
    """Each entry's place is there, its reason is a sentence, and what is written is read again."""
    why = equivalent.reasons()
    for place, reason in why.items():
        file, within, statement, stands, *_ = place
        source = (PACKAGE / file).read_text()
        there = [
            site
            for site in sites(source, file)
            if site.within == within and ast.unparse(site.node) == stands
        ]
        assert there, f"{file}, {within}: {stands} is not there: {statement}"
        assert reason.endswith("."), reason


def test_an_entry_of_the_table_is_read_as_it_was_written(package, tmp_path):
    table = tmp_path / "table.toml"
    made = draw(40, 1, package)
    table.write_text("\n".join(equivalent.row_of(d, "It's one.") for d in made))
    assert equivalent.reasons(table) == {d.place: "It's one." for d in made}


def test_blocks_are_noted_where_they_are_executed(tmp_path):
    package = tmp_path / "noted"
    package.mkdir()
    (package / "__init__.py").write_text('"""It is."""\n\nX = 1\n')
    source = (
        "def f(a):\n    '''It is.'''\n    if a > 0:\n        return 1\n    elif a < 0:\n"
        "        return 2\n    for k in range(3):\n        a += k\n    return a\n"
    )
    (package / "it.py").write_text(source)
    names = note_blocks(package)
    noted = set()
    space = {"__note_block__": noted.add}
    exec((package / "it.py").read_text(), space)
    at = lambda line: block_at(ast.parse(source), "it.py", line)
    for given, lines in ((1, {3, 4}), (-1, {3, 6}), (0, {3, 8})):
        noted.clear()
        space["f"](given)
        executed = {names[k] for k in noted}
        assert {at(line) for line in (3, 4, 6, 8)} & executed == {at(line) for line in lines}
    assert block_at(ast.parse(source), "it.py", 1) is None
    assert len({block.name for block in blocks(ast.parse(source), "it.py")}) == 4


def test_the_interval_of_a_share_is_wilsons():
    """Its ends e fulfil (share − e)² = z² e (1 − e)/n."""
    for caught, of in ((9, 10), (270, 300), (0, 5)):
        share = caught / of
        for end in interval(caught, of):
            spread = end * (1 - end) / of
            assert (share - end) ** 2 == pytest.approx(1.959964**2 * spread, abs=1e-12)


def test_assertions_are_left_alone():
    source = "def f(a, b):\n    return dict(zip(a, b, strict=True), key=len(a) + 1)\n"
    drawn = [slip.kind for site in sites(source, "f.py") for slip in slips(site.node)]
    assert sorted(set(drawn)) == ["arguments", "constant", "default", "sign", "term"]
    assert "True" not in {ast.unparse(site.node) for site in sites(source, "f.py")}
