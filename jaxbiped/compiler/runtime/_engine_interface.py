"""Engines: what runs programs. Each tells what it cannot do, and runs what it can."""

import abc
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import jax.tree_util as jtu
import numpy as np
from jaxtyping import PyTree

from jaxbiped._types import Scalar
from jaxbiped.compiler.runtime._primitive import Recording
from jaxbiped.compiler.runtime._program import Program, Recorded

Shapes: TypeAlias = tuple[tuple[int, ...], ...]


class Request(NamedTuple):
    """A program to run for one simulation, under `vmap` for many, or for a batch.

    Attributes:
        program: what to run. Programs are compared by identity of their functions' owners: who
            asks again should ask with the same one.
        inputs: of one simulation; of a `batch` NumPy's arrays with a leading axis of n.
        room: records that each simulation has room for.
        times: increasing times of the records, shape (m,), where the program has such.
        stream: rows that the program reads: an array (rows, numbers), or the `Recording` or
            `Recorded` of another simulation by the same engine.
        quick: whether a single simulation is over before a user could interrupt.
        batch: whether the inputs are those of n simulations; they are not traced.
        keeps_records: whether records are for another simulation to read; by lanes they stay on
            the host as a `Recording`, which `reads_once` says is read but once.
    """

    program: Program
    inputs: PyTree
    room: int = 0
    times: np.ndarray | None = None
    stream: PyTree = None
    quick: bool = False
    batch: bool = False
    keeps_records: bool = False
    reads_once: bool = False

    def shapes(self) -> tuple[jtu.PyTreeDef, Shapes]:
        """Structure of one simulation's inputs, and the shapes of its leaves. Hashable."""
        leaves, structure = jtu.tree_flatten(self.inputs)
        skipped = 1 if self.batch else 0
        return structure, tuple(np.shape(leaf)[skipped:] for leaf in leaves)


class Result(NamedTuple):
    """Outputs of a request, and its records where the program makes such.

    Attributes:
        outputs: of the program's `finish`; of a batch NumPy's arrays (n, …).
        records: as arrays.
        recording: of records that another simulation may read.
    """

    outputs: PyTree
    records: Recorded | None = None
    recording: Recording | Recorded | None = None


class AbstractEngine(abc.ABC):
    """Runs programs."""

    @abc.abstractmethod
    def can(self, request: Request) -> str | None:
        """None where it can run a request, else the one sentence that says what hinders."""

    @abc.abstractmethod
    def run(self, request: Request) -> Result:
        """Runs a request that it can run, at once or as part of a program of JAX."""

    @abc.abstractmethod
    def jacobian(
        self, function: Callable[[list[Scalar]], list[Scalar]], inputs: Sequence[Scalar]
    ) -> Scalar:
        """Derivatives of scalars with respect to scalars, shape (outputs, inputs), in the way that
        makes the better program here."""
