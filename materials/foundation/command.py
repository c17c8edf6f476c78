"""The frame of every command: logging, progress, and the one place where a failure becomes words and an exit code."""

from __future__ import annotations

import argparse
import errno
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from .early_interrupt import raise_again
from .errors import InputError
from .progress import logger, show_progress

DONE, UNUSABLE, INTERRUPTED, PIPE_CLOSED = 0, 2, 130, 141
_OS_REMEDIES = {
    errno.ENOSPC: ("have space left on its disk", "Free some space or choose another output folder."),
    errno.EDQUOT: ("have space left in its quota", "Free some space or choose another output folder."),
    errno.EFBIG: ("stay below the file size limit", "Raise the limit (ulimit -f) or choose another output folder."),
    errno.EACCES: ("be accessible", "Change its permissions or choose another place."),
    errno.EPERM: ("be accessible", "Change its permissions or choose another place."),
    errno.EROFS: ("be on a disk that can be written to", "Choose another output folder."),
    errno.ENAMETOOLONG: ("have a name that its disk can hold", "Choose a shorter name."),
    errno.ELOOP: ("be no link in a circle", "Check the path."),
    errno.ENOENT: ("exist", "Check the path."),
    errno.EISDIR: ("be a file, not a folder", "Check the path."),
    errno.ENOTDIR: ("lie in a folder, not in a file", "Check the path."),
}


def add_common_flags(parser: argparse.ArgumentParser) -> None:
    """Add what all commands share."""
    parser.add_argument("--settings", metavar="TOML", help="file of settings; flags given here win over it")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    parser.add_argument("--traceback", action="store_true", help="show the Python traceback of a failure")


def run_command(parser: argparse.ArgumentParser, body: Callable[[argparse.Namespace], None], argv: list[str] | None = None) -> int:
    """Parse, run `body`, and return the exit code: 0 done, 2 the input cannot be used, 130 interrupted.

    A known failure prints one line `meniscus: FILE: KEY must …, got …. REMEDY` on stderr. What is not known is a
    defect of ours and keeps its traceback. A parser without the common flags is not quiet and shows no tracebacks.
    """
    raise_again()
    try:
        args = parser.parse_args(argv)
    except SystemExit as stop:  # --help, or flags that argparse refused and explained
        return stop.code if isinstance(stop.code, int) else DONE
    quiet = getattr(args, "quiet", False)
    logging.basicConfig(format="%(message)s", stream=sys.stderr, level=logging.WARNING)
    logger.setLevel(logging.WARNING if quiet else logging.INFO)
    show_progress(not quiet)
    try:
        with _terminate_like_interrupt():
            body(args)
            sys.stdout.flush()
        return DONE
    except KeyboardInterrupt:
        print("meniscus: interrupted; nothing half-written was left", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of our output has seen enough (`… | head`). Python would complain again while it closes stdout.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return PIPE_CLOSED
    except (InputError, OSError, MemoryError) as error:
        if getattr(args, "traceback", False):
            raise
        print(f"meniscus: {explain(error)}", file=sys.stderr)
        return UNUSABLE
    finally:
        show_progress(False)


def explain(error: BaseException) -> str:
    """Turn a known failure into the one-line form."""
    if isinstance(error, InputError):
        return str(error)
    if isinstance(error, MemoryError):
        got = str(error) or "no memory left"
        return str(InputError("fit into memory", got=got, key="the scene", remedy="Use a smaller size or fewer frames."))
    if isinstance(error, OSError):
        must, remedy = _OS_REMEDIES.get(error.errno or 0, ("be usable", "Check the file and try again."))
        got = None if error.errno in _OS_REMEDIES else (error.strerror or str(error))
        return str(InputError(must, got=got, file=error.filename or "output", remedy=remedy))
    raise error


@contextmanager
def _terminate_like_interrupt() -> Iterator[None]:
    """Let SIGTERM unwind like Ctrl-C, so that temporary files go away in either case."""
    if threading.current_thread() is not threading.main_thread():  # signals belong to the main thread
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before if before is not None else signal.SIG_DFL)


def image_slice(text: str | None) -> slice | None:
    """Return which photographs `--images FROM:TO` names; None for all."""
    if text is None:
        return None
    try:
        parts = [int(part) if part else None for part in text.split(":")]
    except ValueError:
        parts = []
    if not 2 <= len(parts) <= 3 or 0 in parts[2:]:
        raise InputError("be FROM:TO or FROM:TO:STEP", got=text, key="--images")
    return slice(*parts)
