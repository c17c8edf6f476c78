"""Progress of all that takes longer than a few seconds; silent where nobody looks."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

logger = logging.getLogger("meniscus")
Item = TypeVar("Item")
_shown = False


def show_progress(shown: bool) -> None:
    """Turn the bars on or off; commands turn them on, notebooks may."""
    global _shown
    _shown = shown


def tracked(items: Iterable[Item], label: str, total: int | None = None) -> Iterator[Item]:
    """Yield the items, with a bar on stderr if progress is shown."""
    if not _shown:
        yield from items
        return
    from rich.console import Console
    from rich.progress import track

    yield from track(items, description=label, total=total, console=Console(stderr=True), transient=not sys.stderr.isatty())


@contextmanager
def stage(label: str) -> Iterator[None]:
    """Log the start of a long step, and how long it took if it succeeds."""
    start = time.perf_counter()
    logger.info("%s …", label)
    yield
    logger.info("%s: %.1f s", label, time.perf_counter() - start)


@contextmanager
def gauge(label: str) -> Iterator[Callable[[float, str], None]]:
    """Yield a function that shows how far work of unknown length is: a share in [0, 1], and words beside the bar."""
    if not _shown:
        yield lambda share, words: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[words]}"))
    with Progress(*columns, console=Console(stderr=True), transient=not sys.stderr.isatty()) as progress:
        task = progress.add_task(label, total=1.0, words="")

        def show(share: float, words: str) -> None:
            progress.update(task, completed=min(max(share, 0.0), 1.0), words=words)

        yield show
