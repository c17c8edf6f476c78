"""What Ctrl-C does before a command runs: a module of entry points imports this before anything that takes time.

While Python still loads modules there is nothing to clean up and nobody to catch `KeyboardInterrupt`, so its traceback
would be all that the user sees. Until `run_command` takes over, the signal ends the process in silence instead.
"""

from __future__ import annotations

import signal
import threading


def end_silently() -> None:
    """Let Ctrl-C end the process, unless somebody has set a handler or the process ignores it."""
    if threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def raise_again() -> None:
    """Undo `end_silently`: Ctrl-C raises KeyboardInterrupt, as Python has it."""
    if threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)
