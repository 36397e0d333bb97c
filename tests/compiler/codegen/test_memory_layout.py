"""Where values lie in memory, against whether many of them are one vector."""

import pytest

from jaxbiped.compiler.codegen._kernel_target import KernelTarget
from jaxbiped.compiler.codegen._llvm_from_graph import GraphWriter, Place
from jaxbiped.compiler.ir._graph import Block, Kind, Value
from jaxbiped.compiler.ir._liveness import Liveness

INNER = 4
"""Entries of a map in one vector, of one simulation."""


def writer_for(width=1, needed=()):
    return GraphWriter(KernelTarget(width, INNER, scales=False), Liveness(needed))


def inputs(block, count):
    return [block.add("input", str(k), kind=Kind.F64) for k in range(count)]


def test_a_map_has_room_for_whole_vectors_of_its_entries():
    one, many = writer_for(), writer_for(8)
    assert [one.padded(length) for length in (0, 1, 4, 5, 8, 9)] == [0, 4, 4, 8, 8, 12]
    assert [many.padded(length) for length in (0, 1, 4, 5)] == [0, 1, 4, 5]
    one.room(Kind.F64, 6)
    many.room(Kind.F64, 6)
    sizes = [w.text.allocations[0].partition("alloca ")[2] for w in (one, many)]
    assert sizes == ["[6 x double], align 64", "[48 x double], align 64"]


@pytest.mark.parametrize(
    ("width", "pointers", "offsets", "found"),
    [
        (1, "aaa", (0, 1, 2), (0, 1)),
        (1, "aaa", (4, 5, 6), (4, 1)),
        (1, "aaa", (2, 3, 4), None),
        (1, "aaa", (0, 2, 4), None),
        (1, "aaa", (0, 1, 3), None),
        (1, "aab", (0, 1, 2), None),
        (1, "bbb", (0, 1, 2), None),
        (1, "a", (8,), (8, 1)),
        (1, "a", (3,), None),
        (8, "aaa", (0, 1, 2), (0, 1)),
        (8, "aaa", (2, 3, 4), (2, 1)),
        (8, "aaa", (1, 4, 7), (1, 3)),
        (8, "aaa", (1, 4, 8), None),
        (8, "bbb", (5, 3, 1), (5, -2)),
        (8, "b", (5,), (5, 1)),
        (8, "aba", (0, 1, 2), None),
    ],
)
def test_values_lie_regularly_where_each_is_as_far_behind_the_other(
    width, pointers, offsets, found
):
    """And of one simulation side by side, from a whole vector on, in memory of whole vectors."""
    writer, values = writer_for(width), inputs(Block(), len(offsets))
    writer.padded_rooms.add("%a")
    for value, pointer, offset in zip(values, pointers, offsets, strict=True):
        writer.homes[id(value)] = Place(f"%{pointer}", offset)
    regular = writer.regular_row(values)
    if found is None:
        assert regular is None
    else:
        assert regular == (Place(f"%{pointers[0]}", found[0]), found[1])
    assert writer.regular_row(inputs(Block(), 2)) is None


def test_a_row_that_lies_irregularly_is_copied_and_one_of_constants_once_for_all():
    block, writer = Block(), writer_for()
    constants = [block.const(k, Kind.F64) for k in (1.0, 2.0, 3.0)]
    pointer, stride = writer._row(constants, 4)
    assert stride == 1
    assert f"{pointer} = alloca [4 x double]" in writer.text.allocations[0]
    assert sum(" store " in line for line in writer.text.allocations) == 3
    assert writer.text.lines == []
    values = inputs(block, 2)
    for k, value in enumerate(values):
        writer.name(value, f"%x{k}")
    writer._row([*values, constants[0]], 4)
    stored = [line for line in writer.text.lines if " store " in line]
    assert [line.split()[2].strip(",") for line in stored] == ["%x0", "%x1", "0x3FF0000000000000"]
    writer.padded_rooms.add("%a")
    for k, value in enumerate(values):
        writer.homes[id(value)] = Place("%a", 4 + k)
    pointer, stride = writer._row(values, 4)
    assert (writer.text.lines[-1], stride) == (
        f"  {pointer} = getelementptr double, ptr %a, i64 4",
        1,
    )


@pytest.mark.parametrize(
    ("rooms", "offsets", "whole"),
    [
        ("ab", (8, 0), True),
        ("ab", (2, 0), False),
        ("a", (8, 0), False),
        ("ab", (4, 4), True),
        ("b", (0, 0), False),
    ],
)
def test_what_a_conditional_chooses_in_memory_stays_there(rooms, offsets, whole):
    """Whole vectors where both are, and lie so many of them apart."""
    block = Block()
    (here,) = (block.add("input", "h", kind=Kind.BOOL),)
    default, inside = inputs(block, 1)[0], Block(block)
    entry = Value("map", (1, Block(inside), (), (default,)), Kind.BOOL, inside)
    value = Value("part", (entry, 0), Kind.F64, inside)
    (part,) = block.region("if", (here, inside, (value,), (default,)), [Kind.F64])
    writer = writer_for(needed=[part])
    writer.padded_rooms |= {f"%{room}" for room in rooms}
    writer.name(here, "%h")
    writer.homes |= {id(value): Place("%a", offsets[0]), id(default): Place("%b", offsets[1])}
    before = set(writer.padded_rooms)
    writer.write(block)
    place = writer.homes[id(part)]
    assert place.offset == offsets[1]
    assert (place.pointer in writer.padded_rooms) == whole
    assert writer.padded_rooms - before == ({place.pointer} if whole else set())
    (chosen,) = (line for line in writer.text.lines if "phi ptr" in line)
    assert chosen.startswith(f"  {place.pointer} = phi ptr [ %b, %entry ], [ ")
    moved = offsets[0] - offsets[1]
    assert any(f"ptr %a, i64 {moved}" in line for line in writer.text.lines) == (moved != 0)


def test_a_choice_of_what_lies_nowhere_is_one_of_registers():
    block = Block()
    here, inside = block.add("input", "h", kind=Kind.BOOL), Block(block)
    x, y = inputs(block, 2)
    doubled = inside.add("fadd", x, y)
    (part,) = block.region("if", (here, inside, (doubled,), (y,)), [Kind.F64])
    for width, of in ((1, "double"), (4, "<4 x double>")):
        writer = writer_for(width, [part])
        for value, name in ((here, "%h"), (x, "%x"), (y, "%y")):
            writer.name(value, name)
        writer.write(block)
        text = "\n".join(writer.text.lines)
        total = next(line.split()[0] for line in writer.text.lines if "fadd" in line)
        assert f"= fadd {of} %x, %y" in text
        assert f"{of} {total}, {of} %y" in text
        chosen = next(line.split()[0] for line in writer.text.lines if " select " in line)
        assert f"phi {of} [ %y, %entry ], [ {chosen}, %" in text
        assert writer.use(part) == text.splitlines()[-1].split()[0]
