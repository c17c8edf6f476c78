"""Measurements: `python -m benchmarks` against peers, `python -m benchmarks.proof` against known truth. Never gates."""
