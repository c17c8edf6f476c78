"""The second contract of the house, for import-linter: kernels import only Numba, NumPy, what Numba compiles, and kernels."""

from __future__ import annotations

from grimp import ImportGraph
from importlinter import Contract, ContractCheck, output

ALLOWED = {"numba", "numpy", "math", "heapq"}  # of the standard library: what Numba compiles
# Code without a job at run time: the future import, and types that only a checker reads.
HARMLESS = {"__future__", "typing", "llvmlite"}


class KernelsContract(Contract):
    """Every module below a `kernels` package keeps to its few imports."""

    def check(self, graph: ImportGraph, verbose: bool) -> ContractCheck:
        strays = [
            (module, imported)
            for module in sorted(graph.modules)
            if _is_kernel(module) and not module.endswith(".kernels")  # the package itself sets Numba up
            for imported in sorted(graph.find_modules_directly_imported_by(module))
            if not _is_kernel(imported) and imported.split(".")[0] not in ALLOWED | HARMLESS
        ]
        return ContractCheck(kept=not strays, metadata={"strays": strays})

    def render_broken_contract(self, check: ContractCheck) -> None:
        for module, imported in check.metadata["strays"]:
            output.print_error(f"{module} must import only {', '.join(sorted(ALLOWED))} and kernels, got {imported}")


def _is_kernel(module: str) -> bool:
    return "kernels" in module.split(".")
