"""`python -m jaxbiped` is `jaxbiped`."""

import signal
import sys
import threading
from typing import Any


def main() -> None:
    """Runs a command and exits; Ctrl-C ends it in one line also while the package is imported."""
    sys.unraisablehook = _repeat_interrupt
    try:
        from jaxbiped.cli import main as run_command

        run_command()
    except KeyboardInterrupt:
        print("jaxbiped: Interrupted.", file=sys.stderr)
        sys.exit(130)
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is written, and the process only ends


def _repeat_interrupt(lost: Any) -> None:
    """Repeats a Ctrl-C that came in a callback, as of a garbage collector, which cannot raise."""
    if lost.exc_type is KeyboardInterrupt:
        main_thread = threading.main_thread().ident
        threading.Timer(0.05, signal.pthread_kill, (main_thread, signal.SIGINT)).start()
    else:
        sys.__unraisablehook__(lost)


if __name__ == "__main__":
    main()
