"""`python -m benchmarks.proof [--only NAME]`: show what is claimed, number by number."""

from __future__ import annotations

import sys

from .runner import run

if __name__ == "__main__":
    sys.exit(run("proof"))
