"""Graphs of operations, against the laws of arithmetic and NumPy's of the same numbers."""

import itertools
import math

import numpy as np
import pytest

from jaxbiped.compiler import host
from jaxbiped.compiler.codegen._kernel_target import KernelTarget, host_target
from jaxbiped.compiler.codegen._llvm_function import FunctionBuilder, literal, vector
from jaxbiped.compiler.ir._graph import Block, Kind, Value
from jaxbiped.compiler.ir._liveness import Liveness, sink_code, sources_of

NUMBERS = [-2.0, -0.0, 0.0, 0.75, 1.0, 3.0, np.inf, np.nan]
FLOATS = {
    "fadd": np.add, "fsub": np.subtract, "fmul": np.multiply, "fdiv": np.divide,
    "fcmp olt": np.less, "fcmp ole": np.less_equal, "fcmp ogt": np.greater,
    "fcmp oge": np.greater_equal,
}  # fmt: skip
WHOLES = {
    "add": np.add, "sub": np.subtract, "icmp slt": np.less, "icmp sle": np.less_equal,
    "icmp sgt": np.greater, "icmp sge": np.greater_equal, "icmp eq": np.equal,
    "icmp ne": np.not_equal,
}  # fmt: skip


def inputs(block, names="xyz", kind=Kind.F64):
    return [block.add("input", name, kind=kind) for name in names]


def told(value):
    """A value as an expression; arguments of what commutes in order."""
    if not isinstance(value, Value):
        return str(value)
    if value.op in ("const", "input"):
        return str(value.args[0])
    parts = [told(each) for each in value.args]
    if value.op in ("fadd", "fmul"):
        parts.sort()
    return f"{value.op}({', '.join(parts)})"


@pytest.mark.parametrize("name", FLOATS)
def test_numbers_are_computed_as_numpy_does(name):
    block, kind = Block(), Kind.BOOL if name.startswith("fcmp") else Kind.F64
    for a, b in itertools.product(NUMBERS, NUMBERS):
        with np.errstate(all="ignore"):
            expected = FLOATS[name](a, b)
        found = block.add(name, block.const(a, Kind.F64), block.const(b, Kind.F64), kind=kind)
        np.testing.assert_array_equal(found.constant, expected)
        assert np.signbit(found.constant) == np.signbit(expected) or np.isnan(expected)
        assert found.kind is kind


@pytest.mark.parametrize("name", WHOLES)
def test_whole_numbers_are_computed_as_numpy_does(name):
    block, kind = Block(), Kind.BOOL if name.startswith("icmp") else Kind.I64
    for a, b in itertools.product((-3, 0, 2, 5), repeat=2):
        found = block.add(name, block.const(a, Kind.I64), block.const(b, Kind.I64), kind=kind)
        assert found.constant == WHOLES[name](a, b)


def test_other_operations_on_numbers():
    block = Block()
    for a in (-2.25, -0.0, 4.0):
        number = block.const(a, Kind.F64)
        assert block.add("fneg", number).constant == -a
        assert block.add("fabs", number).constant == abs(a)
    assert block.add("sqrt", block.const(2.25, Kind.F64)).constant == 1.5
    for a, b in itertools.product((False, True), repeat=2):
        pair = block.const(a, Kind.BOOL), block.const(b, Kind.BOOL)
        for name, expected in (("and", a and b), ("or", a or b), ("xor", a != b)):
            assert block.add(name, *pair).constant == expected
        assert block.add("not", pair[0]).constant == (not a)


X_AND_NUMBER = {
    ("fadd", 0.0): "x", ("fadd", 1.0): "fadd(1.0, x)", ("fsub", 0.0): "x",
    ("fsub", 1.0): "fsub(x, 1.0)", ("fmul", 0.0): "0.0", ("fmul", 1.0): "x",
    ("fmul", -1.0): "fneg(x)", ("fmul", 2.0): "fmul(2.0, x)", ("fdiv", 1.0): "x",
    ("fdiv", 4.0): "fmul(0.25, x)", ("fdiv", -0.5): "fmul(-2.0, x)",
    ("fdiv", 3.0): "fdiv(x, 3.0)", ("fdiv", 0.0): "fdiv(x, 0.0)",
    ("fdiv", 2.0**990): f"fmul({2.0**-990}, x)", ("fdiv", 2.0**-990): f"fmul({2.0**990}, x)",
    ("fdiv", 2.0**1000): f"fdiv(x, {2.0**1000})", ("fdiv", 2.0**-1000): f"fdiv(x, {2.0**-1000})",
}  # fmt: skip
NUMBER_AND_X = {
    ("fadd", 0.0): "x", ("fsub", 0.0): "fneg(x)",
    ("fsub", 1.0): "fsub(1.0, x)", ("fmul", 0.0): "0.0", ("fmul", 1.0): "x",
    ("fmul", -1.0): "fneg(x)", ("fdiv", 1.0): "fdiv(1.0, x)", ("fdiv", 0.0): "fdiv(0.0, x)",
}  # fmt: skip


def test_what_a_number_makes_superfluous_is_not_computed():
    block = Block()
    (x,) = inputs(block, "x")
    for (op, number), expected in X_AND_NUMBER.items():
        assert told(block.add(op, x, block.const(number, Kind.F64))) == expected
    for (op, number), expected in NUMBER_AND_X.items():
        assert told(block.add(op, block.const(number, Kind.F64), x)) == expected
    assert told(block.add("fsub", block.const(-0.0, Kind.F64), x)) == "fsub(-0.0, x)"
    single = block.add("input", "s", kind=Kind.F32)
    zero = block.add("fmul", single, block.const(0.0, Kind.F32))
    assert (zero.constant, zero.kind) == (0.0, Kind.F32)


SIGNS = {
    "fadd": ("fsub(y, x)", "fsub(x, y)", "fneg(fadd(x, y))"),
    "fsub": ("fneg(fadd(x, y))", "fadd(x, y)", "fsub(y, x)"),
    "fmul": ("fneg(fmul(x, y))", "fneg(fmul(x, y))", "fmul(x, y)"),
    "fdiv": ("fneg(fdiv(x, y))", "fneg(fdiv(x, y))", "fdiv(x, y)"),
}


@pytest.mark.parametrize("op", SIGNS)
def test_changes_of_sign_are_moved_out(op):
    """Of the first argument, of the second and of both."""
    block = Block()
    x, y = inputs(block, "xy")
    minus = block.add("fneg", x), block.add("fneg", y)
    pairs = (minus[0], y), (x, minus[1]), minus
    assert tuple(told(block.add(op, *pair)) for pair in pairs) == SIGNS[op]
    assert block.add("fneg", minus[0]) is x


def test_choices_and_conditions_that_are_known_are_not_computed():
    block = Block()
    x, y = inputs(block, "xy")
    a, b = inputs(block, "ab", Kind.BOOL)
    yes, no = (block.const(each, Kind.BOOL) for each in (True, False))
    assert block.add("select", yes, x, y, kind=Kind.F64) is x
    assert block.add("select", no, x, y, kind=Kind.F64) is y
    assert block.add("select", a, x, x, kind=Kind.F64) is x
    assert told(block.add("select", a, x, y, kind=Kind.F64)) == "select(a, x, y)"
    for op, neutral, absorbing in (("and", yes, no), ("or", no, yes)):
        assert block.add(op, a, a) is a
        assert block.add(op, a, neutral) is block.add(op, neutral, a) is a
        assert block.add(op, a, absorbing) is block.add(op, absorbing, a) is absorbing
        assert block.add(op, a, b).op == op


def test_equal_operations_are_one_in_a_block_and_those_within():
    block = Block()
    x, y = inputs(block, "xy")
    total = block.add("fadd", x, y)
    inside, beside = Block(block), Block(block)
    assert block.add("fadd", y, x) is inside.add("fadd", x, y) is total
    assert block.add("fsub", x, y) is not block.add("fsub", y, x)
    product = inside.add("fmul", total, x)
    assert beside.add("fmul", total, x) is not product
    assert inside.add("fmul", x, total) is product
    assert product.block is inside
    assert inside.const(3.0, Kind.F64) is beside.const(3, Kind.F64)
    assert block.add("resize_float", x, kind=Kind.F32) is not block.add("resize_float", x)


def test_a_constant_is_told_by_its_bits_and_its_kind():
    block = Block()
    assert block.const(0.0, Kind.F64) is not block.const(-0.0, Kind.F64)
    assert block.const(math.nan, Kind.F64) is block.const(math.nan, Kind.F64)
    assert block.const(1.0, Kind.F64) is not block.const(1.0, Kind.F32)
    assert block.const(0.1, Kind.F32).constant == float(np.float32(0.1))
    assert block.const(2, Kind.BOOL).constant == 1
    assert isinstance(block.const(2.0, Kind.I32).constant, int)
    (x,) = inputs(block, "x")
    assert x.constant is None


def test_what_does_not_depend_on_a_loop_s_run_is_computed_before_it():
    first = Block(invariant=True)
    (x,) = inputs(first, "x")
    body = Block(first)
    loop = Block(body, loop=True)
    inner = Block(loop, loop=True)
    body.values.append(held := Value("held", (), Kind.F64, body))
    loop.values.append(own := Value("taken", (), Kind.F64, loop))
    assert inner.add("fadd", x, inner.const(2.0, Kind.F64)).block is first
    assert inner.add("fadd", held, x).block is body
    assert inner.add("fadd", held, own).block is loop
    assert Block(inner).add("fmul", held, own).block is not first


def test_what_is_made_of_values_or_called_is_made_once():
    block, count = Block(), itertools.count()
    x, y = inputs(block, "xy")

    def make(home):
        next(count)
        return home.add("fmul", x, y)

    inside = Block(block)
    first = block.shared("twice", [x, y], make)
    assert inside.shared("twice", [x, y], make) is first
    assert next(count) == 1
    block.shared("twice", [y, x], make)
    assert next(count) == 3
    calls = []
    for _ in range(2):
        assert inside.call(("f", id(x)), lambda: calls.append(1) or len(calls)) == 1
    Block(block).call(("f", id(x)), lambda: calls.append(1))
    assert len(calls) == 2
    block.forget_calls()
    assert inside.call(("f", id(x)), lambda: 7) == 7


def test_a_product_joins_the_sum_that_alone_uses_it():
    block = Block()
    x, y, z = inputs(block)
    product, other = block.add("fmul", x, y), block.add("fmul", y, z)
    total, difference = block.add("fadd", product, z), block.add("fsub", z, other)
    both = block.add("fsub", total, difference)
    alive = Liveness([both])
    assert alive.fused == {id(total): total.args.index(product), id(difference): 1}
    assert alive.absorbed == {id(product), id(other)}
    assert all(value in alive for value in (both, product, x))
    more = Liveness([both, product])  # which is a result itself
    assert more.absorbed == {id(other)}
    only = Liveness([total])
    assert difference not in only
    two = block.add("fadd", block.add("fmul", x, x), block.add("fmul", z, z))
    assert list(Liveness([two]).fused.values()) == [0]  # of two products the first
    inside = Block(block)
    inside.values.append(own := Value("held", (), Kind.F64, inside))
    outer = inside.add("fadd", block.add("fmul", x, z), own)
    assert Liveness([outer]).fused == {}


def conditional(block, here, values, defaults):
    inside = Block(block)
    made = values(inside)
    kinds = [each.kind for each in made]
    return block.region("if", (here, inside, tuple(made), tuple(defaults)), kinds), inside


def test_a_part_of_a_conditional_needs_its_own_branches_alone():
    block = Block()
    x, y, z = inputs(block)
    (here,) = inputs(block, "h", Kind.BOOL)
    (one, two), _ = conditional(
        block, here, lambda b: (b.add("fadd", x, y), b.add("fmul", y, z)), (x, z)
    )
    head = one.args[0]
    assert sources_of(head) == [here]
    assert [told(each) for each in list(sources_of(one))[1:]] == ["fadd(x, y)", "x"]
    assert [told(each) for each in list(sources_of(two))[1:]] == ["fmul(y, z)", "z"]
    alive = Liveness([one])
    assert y in alive
    assert z not in alive
    assert two not in alive


def test_what_one_branch_alone_needs_is_computed_there():
    block = Block()
    x, y, z = inputs(block)
    (here,) = inputs(block, "h", Kind.BOOL)
    alone, everywhere = block.add("fmul", x, y), block.add("fmul", y, z)
    before = block.add("fadd", x, z)
    (one, two), inside = conditional(
        block, here,
        lambda b: (b.add("fadd", alone, everywhere), before),
        (everywhere, before),
    )  # fmt: skip
    sink_code([one, two])
    assert alone.block is inside
    assert inside.values[0] is alone
    assert alone not in block.values
    assert everywhere.block is block
    assert before.block is block  # which is also what it gives otherwise
    asked = block.add("fmul", x, z)
    (third,), within = conditional(block, here, lambda b: (b.add("fadd", asked, y),), (y,))
    sink_code([third, asked])
    assert asked.block is block
    assert within.values[-1].op == "fadd"


def test_what_a_branch_gives_and_nothing_else_uses_is_computed_there():
    block = Block()
    x, y, z = inputs(block)
    (here,) = inputs(block, "h", Kind.BOOL)
    given, otherwise = block.add("fmul", x, y), block.add("fmul", y, z)
    (one,), inside = conditional(block, here, lambda b: (given,), (otherwise,))
    sink_code([one])
    assert given.block is inside
    assert inside.values == [given]
    assert otherwise.block is block


def test_a_part_of_a_map_needs_its_own_value_and_its_own_row():
    block = Block()
    x, y, z = inputs(block)
    rows = (x, y, z), (z, x, y)
    inside = Block(block, loop=True)
    entries = inside.region("taken", (rows,), [Kind.F64] * 2)
    values = inside.add("fmul", entries[0], x), inside.add("fadd", entries[1], y)
    parts = block.region("map", (3, inside, tuple(entries), values), [Kind.F64] * 6)
    head, taken = parts[0].args[0], entries[0].args[0]
    assert list(sources_of(head)) == list(sources_of(taken)) == []
    for place, part in enumerate(parts):
        assert list(sources_of(part)) == [head, values[place // 3]]
    for row, entry in zip(rows, entries, strict=True):
        assert list(sources_of(entry)) == [taken, *row]
    alive = Liveness([parts[2]])
    assert values[0] in alive
    assert values[1] not in alive


def test_a_loop_needs_its_starts_and_all_that_it_carries():
    block = Block()
    x, y, _ = inputs(block)
    inside = Block(block, loop=True)
    held = Value("held", (), Kind.F64, inside)
    inside.values.append(held)
    end = inside.add("fmul", held, y)
    (part,) = block.region("repeat", (7, inside, (x,), (held,), (end,)), [Kind.F64])
    assert list(sources_of(part.args[0])) == [x, held, end]
    assert list(sources_of(part)) == [part.args[0]]
    assert list(sources_of(held)) == []
    assert all(each in Liveness([part]) for each in (x, y, held, end))


def test_numbers_types_and_memory_in_llvm_s_words():
    assert literal(1.0, Kind.F64) == "0x3FF0000000000000"
    assert literal(-0.0, Kind.F32) == "0x8000000000000000"
    assert literal(True, Kind.BOOL) == literal(1.0, Kind.I32) == "1"
    assert vector(Kind.F64, 1) == "double"
    assert vector(Kind.I32, 4) == "<4 x i32>"
    for kind, width, align in (
        (Kind.F64, 1, 8), (Kind.F64, 8, 64), (Kind.F64, 3, 8), (Kind.F32, 4, 16),
        (Kind.BOOL, 1, 1), (Kind.BOOL, 8, 8), (Kind.I32, 3, 4),
    ):  # fmt: skip
        text = FunctionBuilder()
        text.load("%p", kind, width)
        text.store("%a", "%p", kind, width)
        memory = [line for line in text.lines if " load " in line or " store " in line]
        assert [line.rpartition("align ")[2] for line in memory] == [str(align)] * 2
    assert FunctionBuilder().address("%p", Kind.F64, 0) == "%p"
    text = FunctionBuilder()
    assert text.room(Kind.BOOL, 6) != text.room(Kind.F64, 3)
    assert [line.partition("alloca ")[2] for line in text.allocations] == [
        "[6 x i8], align 64", "[3 x double], align 64",
    ]  # fmt: skip
    assert text.any_lane("%m", 1) == "%m"
    assert text.declarations == set()


def test_what_is_loaded_in_a_scope_is_known_there_and_within():
    text, count = FunctionBuilder(), itertools.count()

    def make():
        return f"%{next(count)}"

    assert text.cached("a", make) == "%0"
    with text.scope():
        assert text.cached("a", make) == "%0"
        assert text.cached("b", make) == text.cached("b", make) == "%1"
    assert text.cached("b", make) == "%2"


def test_a_module_declares_what_it_calls_and_does_not_define():
    lines = {"declare double @sin(double)", "declare double @own(double)"}
    target = KernelTarget(
        1, 4, scales=False, declared=frozenset({"declare i1 @vote(i1)"}), defined=frozenset({"own"})
    )
    assert target.declarations(lines) == ["declare double @sin(double)", "declare i1 @vote(i1)"]
    mine = host_target(2, host())
    assert (mine.width, mine.inner, mine.scales) == (2, host().width, host().scales)
    assert mine.architecture == host().triple.split("-")[0]
    assert (mine.votes, mine.convention, mine.library, mine.rest) == (False, "", "", "")
