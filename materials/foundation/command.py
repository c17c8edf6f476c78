"""The frame of every command: logging, progress, and the one place where a failure becomes words and an exit code."""

from __future__ import annotations

import argparse
import errno
import logging
import signal
import sys
from collections.abc import Callable

from .errors import InputError
from .progress import logger, show_progress

_OS_REMEDIES = {
    errno.ENOSPC: ("have space left on its disk", "Free some space or choose another output folder."),
    errno.EDQUOT: ("have space left in its quota", "Free some space or choose another output folder."),
    errno.EFBIG: ("stay below the file size limit", "Raise the limit (ulimit -f) or choose another output folder."),
    errno.EACCES: ("be accessible", "Change its permissions or choose another place."),
    errno.EPERM: ("be accessible", "Change its permissions or choose another place."),
    errno.EROFS: ("be on a disk that can be written to", "Choose another output folder."),
    errno.ENOENT: ("exist", "Check the path."),
}


def add_common_flags(parser: argparse.ArgumentParser) -> None:
    """Add what all commands share."""
    parser.add_argument("--settings", metavar="TOML", help="file of settings; flags given here win over it")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    parser.add_argument("--traceback", action="store_true", help="show the Python traceback of a failure")


def run_command(parser: argparse.ArgumentParser, body: Callable[[argparse.Namespace], None], argv: list[str] | None = None) -> int:
    """Parse, run `body`, and return the exit code: 0 done, 2 the input cannot be used, 130 interrupted.

    A known failure prints one line `meniscus: FILE: KEY must …, got …. REMEDY` on stderr. What is not known is a
    defect of ours and keeps its traceback.
    """
    args = parser.parse_args(argv)
    logging.basicConfig(format="%(message)s", stream=sys.stderr, level=logging.WARNING)
    logger.setLevel(logging.WARNING if args.quiet else logging.INFO)
    show_progress(not args.quiet)
    # SIGTERM unwinds like Ctrl-C, so that temporary files go away in either case.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        body(args)
        return 0
    except KeyboardInterrupt:
        print("meniscus: interrupted; nothing half-written was left", file=sys.stderr)
        return 130
    except (InputError, OSError, MemoryError) as error:
        if args.traceback:
            raise
        print(f"meniscus: {explain(error)}", file=sys.stderr)
        return 2


def explain(error: BaseException) -> str:
    """Turn a known failure into the one-line form."""
    if isinstance(error, InputError):
        return str(error)
    if isinstance(error, MemoryError):
        return str(InputError("fit into memory", got=str(error) or "no memory left", key="the scene", remedy="Use a smaller size or fewer frames."))
    if isinstance(error, OSError):
        must, remedy = _OS_REMEDIES.get(error.errno or 0, ("be usable", "Check the file and try again."))
        got = None if error.errno in _OS_REMEDIES else (error.strerror or str(error))
        return str(InputError(must, got=got, file=error.filename or "output", remedy=remedy))
    raise error
