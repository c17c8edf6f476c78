"""The fit of a texel against Ceres and SciPy: same residuals and derivatives (compiled), same starts and bounds, equal cost.

A texel is Cook-Torrance gloss with two anisotropic lobes on a bent normal, 151 x 151 directions, three channels, noise; the
normal is free within 0.2 rad. All run on one thread; ours on both cores is stated by itself.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from materials.abrdf import ABRDF, pairs
from materials.directions import even_directions
from materials.fit import FitSettings, fit_where_possible
from materials.fit_problem import KINDS, Problem
from materials.kernels.brdf_fit import terms

from .peers import ceres as load_ceres
from .report import Report
from .residuals import residuals
from .timing import paired, seconds

Floats = NDArray[np.float64]
_F0 = 0.04
_WIDTHS = ((0.15, 0.6), (0.35, 0.85))
_TILT = 0.2


def run(report: Report) -> None:
    """Record seconds per texel of ours, Ceres and SciPy, and the cost that each reaches."""
    ceres = load_ceres()
    problems = [_texel(seed) for seed in range(3)]

    def ours() -> list[float]:
        return [p.minimise([p.start(w) for w in _WIDTHS], _bounds(p))[1] for p in problems]

    def theirs() -> list[float]:
        return [min(_ceres(ceres, p, p.start(w)) for w in _WIDTHS) for p in problems]

    def scipy() -> list[float]:
        return [min(_scipy(p, p.start(w)) for w in _WIDTHS) for p in problems]

    name = f"fit of a texel, ct, two lobes, {len(problems[0].wi)} samples x 3"
    reached = np.mean(ours())
    for peer, other, runs in ((f"Ceres (pyceres {ceres.__version__})", theirs, 3), ("SciPy least_squares", scipy, 1)):
        timed, cost = paired(ours, other, runs), np.mean(other())
        report.figure(
            name=name,
            ours=timed.ours / len(problems),
            peer=f"{peer}, cost {cost / reached:.5f} of ours",
            theirs=timed.theirs / len(problems),
            unit="s",
            error_reached=float(reached),
        )
    _whole_texture(report)


def _whole_texture(report: Report) -> None:
    """Record texels per second of the thesis's fit with normals on all cores, and the minutes that 256 x 256 would take."""
    texels = [_texel(seed) for seed in range(16)]
    wi, wo = texels[0].wi, texels[0].wo
    value = np.stack([t.value for t in texels]).astype(np.float32)
    abrdf = ABRDF(wi, wo, value, np.ones(value.shape[:2], bool), np.ones(len(wi)))
    settings = FitSettings(model="ct", normals=True)
    fit_where_possible(abrdf, settings)
    each = seconds(lambda: fit_where_possible(abrdf, settings)) / len(texels)
    report.figure(name="thesis's fit with normals, two cores: texels per second", ours=1 / each, unit="1/s")
    report.figure(name="the same: minutes for 256 x 256 texels, extrapolated", ours=65536 * each / 60, unit="min")


def _texel(seed: int) -> Problem:
    """Return noisy samples of a known material."""
    rng = np.random.default_rng(seed)
    dome = even_directions(151)
    wi, wo = pairs(dome, dome)
    truth = Problem(wi, wo, np.zeros((len(wi), 3)), KINDS["ct"], _F0, np.eye(3), 2, 1.0)
    tilt = rng.uniform(-0.15, 0.15, 2)
    specular = [*rng.uniform(0.3, 0.8, 3), *rng.uniform(0.1, 0.4, 3)]
    x = np.array([*rng.uniform(0.1, 0.4, 3), *specular, 0.15, 0.25, 0.6, 0.8, *tilt, rng.uniform(-0.7, 0.7)])
    d, s, a, _ = truth.split(x)
    factor, t = terms(wi, wo, truth.kind, _F0, truth.frame(x), np.ascontiguousarray(a))
    value = factor[:, None] * (d / np.pi + t[:, :, 0] @ s)
    value = np.maximum(value + 0.005 * rng.standard_normal(value.shape), 0)
    return Problem(wi, wo, value, KINDS["ct"], _F0, np.eye(3), 2, 1.0)


def _bounds(problem: Problem) -> tuple[Floats, Floats]:
    return problem.bounds([(0.1, 0.5), (0.5, 0.95)], tilt=_TILT)


def _ceres(ceres: Any, problem: Problem, start: Floats) -> float:
    """Return the cost that Ceres reaches: trust region, Levenberg-Marquardt, dense normal equations."""
    n = problem.value.size

    class Cost(ceres.CostFunction):
        def __init__(self) -> None:
            ceres.CostFunction.__init__(self)
            self.set_num_residuals(n)
            self.set_parameter_block_sizes([problem.size])

        def Evaluate(self, parameters: Any, out: Any, jacobians: Any) -> bool:
            slopes = jacobians[0].reshape(n, problem.size) if jacobians is not None else np.empty((0, 0))
            at = np.asarray(parameters[0])
            residuals(problem.wi, problem.wo, problem.value, problem.kind, problem.f0, problem.base, at, problem.lobes, out, slopes)
            return True

    low, high = _bounds(problem)
    x = np.clip(start, low, high)
    task, cost = ceres.Problem(), Cost()
    task.add_residual_block(cost, None, [x])
    for k in range(problem.size):
        task.set_parameter_lower_bound(x, k, low[k])
        if np.isfinite(high[k]):
            task.set_parameter_upper_bound(x, k, high[k])
    options = ceres.SolverOptions()
    options.linear_solver_type = ceres.LinearSolverType.DENSE_NORMAL_CHOLESKY
    options.function_tolerance, options.max_num_iterations, options.num_threads = 1e-7, 200, 1
    summary = ceres.SolverSummary()
    ceres.solve(options, task, summary)
    return 2 * summary.final_cost / n


def _scipy(problem: Problem, start: Floats) -> float:
    """Return the cost that SciPy's trust-region-reflective method reaches."""
    from scipy.optimize import least_squares

    n = problem.value.size
    low, high = _bounds(problem)
    given = (problem.wi, problem.wo, problem.value, problem.kind, problem.f0, problem.base)

    def values(x: Floats) -> Floats:
        out = np.empty(n)
        residuals(*given, x, problem.lobes, out, np.empty((0, 0)))
        return out

    def slopes(x: Floats) -> Floats:
        out, jacobian = np.empty(n), np.empty((n, problem.size))
        residuals(*given, x, problem.lobes, out, jacobian)
        return jacobian

    inside = np.clip(start, low + 1e-9, high - 1e-9)
    found = least_squares(values, inside, slopes, bounds=(low, high), ftol=1e-7, xtol=1e-9, gtol=None, x_scale="jac", max_nfev=200)
    return float(2 * found.cost / n)
