"""Compiler: programs of JAX as vector machine code for the host's CPU, one simulation a lane.

It knows no walker. The rest of the project uses what is exported here and nothing behind it.
"""

from jaxbiped.compiler.ir._lower_jaxpr import UnknownPrimitiveError as UnknownPrimitiveError
from jaxbiped.compiler.passes._operation_counts import count_operations as count_operations
from jaxbiped.compiler.passes._vertex_elimination import jacobian as jacobian
from jaxbiped.compiler.runtime._compiled_program import CompiledProgram as CompiledProgram
from jaxbiped.compiler.runtime._compiled_program import Recorded as Recorded
from jaxbiped.compiler.runtime._primitive import Recording as Recording
from jaxbiped.compiler.runtime._primitive import Schedule as Schedule
from jaxbiped.compiler.runtime._primitive import call as call
from jaxbiped.compiler.runtime._primitive import call_recording as call_recording
from jaxbiped.compiler.runtime._primitive import deferred_checks as deferred_checks
from jaxbiped.compiler.runtime._program import Program as Program
from jaxbiped.compiler.runtime._threads import THREADS_VARIABLE as THREADS_VARIABLE
from jaxbiped.compiler.runtime._threads import default_threads as default_threads
