"""PTX assembled by the wheel's `ptxas`, as the experiments do it."""

import _ptxas
import pytest


def assembled(ptx, architecture):
    """Registers of a thread and bytes spilt; without the assembler the test is skipped."""
    tool = _ptxas.ptxas()
    if tool is None:
        pytest.skip("ptxas is not installed: pip install nvidia-cuda-nvcc-cu12")
    return _ptxas._assembled(tool, ptx, architecture.name)
