"""Compiler: programs of JAX as machine code, one simulation a lane of a CPU or a device's thread.

It knows no walker. The rest of the project uses what is exported here and nothing behind it: three
engines that run a `Program`, `LANES`, `CUDA` and their twin `XLA`, each by `can(request)` and
`run(request)`.
"""

from jaxbiped.compiler._fusion_barrier import fusion_barrier as fusion_barrier
from jaxbiped.compiler._fusion_barrier import without_barriers as without_barriers
from jaxbiped.compiler.codegen._ptx_kernel import ARCHITECTURES as ARCHITECTURES
from jaxbiped.compiler.codegen._ptx_kernel import ptx_text as ptx_text
from jaxbiped.compiler.host_code._host_jit import host_jit as host_jit
from jaxbiped.compiler.host_code._host_jit import kept_alone as kept_alone
from jaxbiped.compiler.ir._vertex_elimination import jacobian as jacobian
from jaxbiped.compiler.ir._vertex_elimination import partial_derivatives as partial_derivatives
from jaxbiped.compiler.runtime._engines import AbstractEngine as AbstractEngine
from jaxbiped.compiler.runtime._engines import LaneEngine as LaneEngine
from jaxbiped.compiler.runtime._engines import LoopEngine as LoopEngine
from jaxbiped.compiler.runtime._engines import Request as Request
from jaxbiped.compiler.runtime._engines import Result as Result
from jaxbiped.compiler.runtime._machine_code import default_threads as default_threads
from jaxbiped.compiler.runtime._machine_code import host as host
from jaxbiped.compiler.runtime._primitive import Recording as Recording
from jaxbiped.compiler.runtime._primitive import deferred_checks as deferred_checks
from jaxbiped.compiler.runtime._processors import DeviceProcessor as DeviceProcessor
from jaxbiped.compiler.runtime._program import Program as Program
from jaxbiped.compiler.runtime._program import Recorded as Recorded
from jaxbiped.compiler.runtime._program import count_operations as count_operations
from jaxbiped.compiler.runtime._web_assembly import web_module as web_module

LANES = LaneEngine()
"""Vector machine code for the host's CPU."""
DEVICES = DeviceProcessor()
"""This machine's CUDA devices."""
CUDA = LaneEngine(DEVICES)
"""The same programs on CUDA devices, one simulation a thread."""
XLA = LoopEngine()
"""The same programs as loops of XLA."""
BY_NAME: dict[str, AbstractEngine] = {"xla": XLA, "lanes": LANES, "cuda": CUDA}
"""Engines by name. One that is added here runs rigid walks and labels."""
