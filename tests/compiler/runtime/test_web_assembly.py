"""Modules of WebAssembly, against the format's own words: numbers, sections and imports."""

import pytest

from jaxbiped.compiler.runtime._web_assembly import (
    _encoded,
    _exporting,
    _imported_functions,
    _number,
    _sections,
)

HEADER = b"\0asm\1\0\0\0"
NUMBERS = {0: b"\x00", 1: b"\x01", 127: b"\x7f", 128: b"\x80\x01", 624485: b"\xe5\x8e\x26"}
"""The last one is the example of the format's documentation of LEB128."""


@pytest.mark.parametrize("value", NUMBERS)
def test_numbers_have_seven_bits_a_byte(value):
    assert _encoded(value) == NUMBERS[value]
    assert _number(b"\xff" + NUMBERS[value] + b"\x05", 1) == (value, 1 + len(NUMBERS[value]))


def named(text):
    return bytes([len(text)]) + text.encode()


def imported(kind, rest):
    return named("env") + named(f"of_{kind}") + bytes([kind]) + rest


FUNCTION, LONG_FUNCTION = imported(0, b"\x01"), imported(0, b"\x80\x01")
TABLE, BOUNDED_TABLE = imported(1, b"\x70\x00\x02"), imported(1, b"\x70\x01\x02\x80\x01")
MEMORY, BOUNDED_MEMORY = imported(2, b"\x00\x80\x02"), imported(2, b"\x01\x01\x80\x02")
GLOBAL = imported(3, b"\x7f\x01")


@pytest.mark.parametrize("last", [FUNCTION, LONG_FUNCTION])
@pytest.mark.parametrize(
    "others",
    [
        (), (TABLE,), (BOUNDED_TABLE,), (MEMORY,), (BOUNDED_MEMORY,), (GLOBAL,),
        (GLOBAL, BOUNDED_MEMORY, TABLE), (FUNCTION, LONG_FUNCTION, GLOBAL, FUNCTION),
    ],
)  # fmt: skip
def test_imported_functions_are_counted_among_all_imports(others, last):
    own = sum(each in (FUNCTION, LONG_FUNCTION) for each in others)
    for every in ((*others, last), (last, *others)):
        assert _imported_functions(bytes([len(every)]) + b"".join(every)) == own + 1
    assert _imported_functions(b"\0") == 0


def section(kind, body):
    return bytes([kind]) + _encoded(len(body)) + body


def test_the_first_own_function_is_exported_and_what_only_a_linker_reads_is_left_out():
    """Sections follow in the order of their numbers; that of counted data comes before code."""
    imports, code = b"\x02" + FUNCTION + GLOBAL, b"\x00" * 300
    given = [(1, b"t"), (2, imports), (3, b"f"), (12, b"\x01"), (10, code), (11, b"d")]
    written = HEADER + b"".join(section(*each) for each in given)
    with_custom = written + section(0, b"linking")
    assert list(_sections(with_custom)) == [*given, (0, b"linking")]
    found = _exporting(with_custom, "walk")
    assert found[:8] == HEADER
    export = 7, b"\x01" + named("walk") + b"\x00\x01"
    assert list(_sections(found)) == [*given[:3], export, *given[3:]]
    without = HEADER + section(1, b"t") + section(3, b"f") + section(10, code)
    assert (7, b"\x01" + named("run") + b"\x00\x00") in list(_sections(_exporting(without, "run")))
