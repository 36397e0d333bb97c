"""WebAssembly: a program's kernel as a module that a page runs, one simulation after the other.

What LLVM writes for one function is a module already, but for the export of that function: memory,
the pointer to its stack and the C library's functions for rare arguments are imports that the page
gives, and its constants lie at the start of the memory. So nothing has to be linked.
"""

from collections.abc import Iterator

from jaxbiped.compiler.codegen._kernel_target import host_target
from jaxbiped.compiler.codegen._lane_kernel import ENTRY, kernel_text
from jaxbiped.compiler.codegen._software_fma import with_software_fma
from jaxbiped.compiler.runtime._host_cpu import Host
from jaxbiped.compiler.runtime._machine_code import foreign_machine, optimised_module
from jaxbiped.compiler.runtime._program import Graph

_PAGE = Host("wasm32-unknown-unknown", "generic", "+bulk-memory", 1, False)
_CUSTOM, _IMPORT, _EXPORT = 0, 2, 7
_PLACES = {12: 9.5}
"""Sections stand by their numbers, but for the data's count."""


def web_module(graph: Graph) -> bytes:
    """A module of WebAssembly whose export `jaxbiped_run` takes the address of a kernel's fields.

    Its results are those of the host's code to the last bit, but where the C library is asked, or
    where numbers are below the smallest normal one.

    Args:
        graph: of a program without maps over arrays.

    Returns:
        The module. Imports from `env`: memory, its stack's pointer, the C library's functions.
    """
    machine = foreign_machine(_PAGE.triple, cpu=_PAGE.cpu, features=_PAGE.features)
    text = with_software_fma(kernel_text(graph, host_target(1, _PAGE)))
    module = optimised_module(text, machine, triple=_PAGE.triple)
    return _exporting(bytes(machine.emit_object(module)), ENTRY)


def _exporting(written: bytes, name: str) -> bytes:
    """A module with its first own function exported, without what only a linker reads."""
    sections = [(kind, body) for kind, body in _sections(written) if kind != _CUSTOM]
    imports = next((body for kind, body in sections if kind == _IMPORT), b"\0")
    place = _imported_functions(imports)
    export = bytes([1, len(name)]) + name.encode() + b"\0" + _encoded(place)
    sections.append((_EXPORT, export))
    sections.sort(key=lambda section: _PLACES.get(section[0], section[0]))
    return written[:8] + b"".join(bytes([k]) + _encoded(len(b)) + b for k, b in sections)


def _sections(module: bytes) -> Iterator[tuple[int, bytes]]:
    place = 8
    while place < len(module):
        kind = module[place]
        size, place = _number(module, place + 1)
        yield kind, module[place : place + size]
        place += size


def _imported_functions(imports: bytes) -> int:
    """How many of the imports are functions: their indices come before a module's own."""
    many, place = _number(imports, 0)
    functions = 0
    for _ in range(many):
        for _ in range(2):  # the module's name and the import's
            size, place = _number(imports, place)
            place += size
        kind, place = imports[place], place + 1
        if kind == 0:
            functions, place = functions + 1, _number(imports, place)[1]
        elif kind == 3:
            place += 2
        else:
            place += kind == 1  # a table's type, then limits as a memory has them
            bounded, place = imports[place], place + 1
            for _ in range(1 + (bounded & 1)):
                place = _number(imports, place)[1]
    return functions


def _number(data: bytes, place: int) -> tuple[int, int]:
    """A number in seven bits a byte, and the place behind it."""
    value = shift = 0
    while True:
        byte = data[place]
        value, shift, place = value | (byte & 127) << shift, shift + 7, place + 1
        if byte < 128:
            return value, place


def _encoded(value: int) -> bytes:
    parts = []
    while value > 127:
        parts.append(value & 127 | 128)
        value >>= 7
    return bytes([*parts, value])
