"""`python -m benchmarks [--only NAME]`: measure against peers."""

from __future__ import annotations

import sys

from .runner import run

if __name__ == "__main__":
    sys.exit(run("bench"))
