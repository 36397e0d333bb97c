"""Flushed subnormals, against bits: zero within a kernel, around it all is as it was."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxbiped.compiler.codegen._kernel_target import KernelTarget
from jaxbiped.compiler.codegen._llvm_lane_loop import kernel_text
from jaxbiped.compiler.runtime._machine_code import foreign_machine, optimised_module
from tests.compiler.one_shot import compiled, evaluate

SUBNORMAL = 1e-310


@pytest.mark.parametrize("width", [1, 2, 4, 8, 16])
def test_results_and_arguments_without_leading_digits_are_zero(width):
    given = np.array([[SUBNORMAL, 1e300], [1e-160, 1e-160], [-1e-160, 1e-160], [1e-150, 1e-150]])
    found = evaluate(lambda x: x[0] * x[1], given, width=width)
    np.testing.assert_array_equal(found, [0.0, 0.0, -0.0, 1e-150 * 1e-150])
    assert np.signbit(found).tolist() == [False, False, True, False]


def test_a_jitted_function_gives_the_same_bits():
    given = 10.0 ** -np.arange(300.0, 324.0)
    own = evaluate(lambda x: x * 1.5 + 1e-308, given)
    by_xla = jax.jit(lambda x: x * 1.5 + 1e-308)(jnp.asarray(given))
    np.testing.assert_array_equal(own, by_xla)


def test_the_thread_that_runs_it_keeps_its_subnormals():
    product = compiled(lambda x: x * 0.5, ())
    # What is quick runs in this thread.
    found = product.run([np.array([SUBNORMAL])], threads=1, quick=True).outputs
    assert found[0] == 0.0
    assert np.float64(SUBNORMAL) * np.float64(0.5) == 0.5 * SUBNORMAL > 0.0


def test_code_for_arm_flushes_too():
    graph = compiled(lambda x: x * 0.5, ()).kernel.graph
    for architecture, flushes in (("aarch64", True), ("riscv64", False)):
        text = kernel_text(graph, KernelTarget(2, 2, scales=False, architecture=architecture))
        machine = foreign_machine("aarch64-unknown-linux-gnu", cpu="generic", features="")
        module = optimised_module(text, machine, triple="aarch64-unknown-linux-gnu")
        assembly = str(machine.emit_assembly(module)).lower()
        assert assembly.count("msr\tfpcr") == (2 if flushes else 0)
        assert assembly.count("mrs") == (1 if flushes else 0)
