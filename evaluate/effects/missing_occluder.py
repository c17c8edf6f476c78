"""A body that nobody believed in, and that throws a shadow."""

from __future__ import annotations

from typing import Any

import numpy as np

from scene.simulation import Texture

from ..kernels import shadows
from ..mismatch.case import Case
from ..mismatch.effect import Context, Effect, Parameter, Values
from ..mismatch.formation import State, eyes, frame_of, sight


class MissingOccluder(Effect):
    id = "missing_occluder"
    stage = "light"
    title = "an unseen body that casts a shadow"
    says = "patches are dark under some lamps and not under others, and where they lie follows from the lamps"
    taken_for = ("albedo_error", "moved_object")
    decides = "look from the lamp: what hides the dark patch from it?"
    coordinates = "lamp"
    approximation = 0.05

    def targets(self, case: Case) -> list[str | None]:
        return [None] if len(case.lamps) else []

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        low, high = self._box(case)
        size = float(np.linalg.norm(high - low))
        centre = [
            Parameter(f"centre.{a}", 0.5 * (lo + hi), lo - size, hi + size, 0.0006 * size, "m")
            for a, lo, hi in zip("xyz", low, high, strict=True)
        ]
        # Where it stands in the view it is taken for a matte ball.
        albedo = [Parameter(f"albedo.{c}", 0.2, 0.0, 1.0, 0.02, spread=0.3) for c in "rgb"]
        return (*centre, Parameter("radius", 0.08 * size, 0.005 * size, 0.5 * size, 0.0006 * size, "m"), *albedo)

    def _box(self, case: Case) -> tuple[np.ndarray, np.ndarray]:
        p = case.pieces.position[case.pieces.shape >= 0]
        low, high = np.quantile(p, 0.02, axis=0), np.quantile(p, 0.98, axis=0)
        # Bodies stand between what is seen and the lamps.
        up = 0.6 * float(np.linalg.norm(high[:2] - low[:2]))
        return low.astype(float), np.maximum(high, [*high[:2], low[2] + up]).astype(float)

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        """Vote: which sphere, wherever it stands, has its shadow where the recording is darker than it should be?"""
        p, frame = case.pieces, frame_of(case)
        slots = case.slots[frame]
        rng = np.random.default_rng(1)
        lamp, best_lit = slots[:, 0], p.visible[:, 0]
        rows = np.flatnonzero((p.weight > 0.9) & (best_lit > 0.9) & (p.shape >= 0))
        if not len(rows):
            return False
        rows = rng.permutation(rows)[:6000]
        # Gain in chi-square if all light were gone: w (r² - (r + I)²).
        lit, r = context.picture.reshape(-1, 3)[p.pixel[rows]], context.residual.reshape(-1, 3)[p.pixel[rows]]
        w = context.weight.reshape(-1, 3)[p.pixel[rows]]
        gain = np.clip((w * (r * r - (r + lit) ** 2)).sum(axis=1), -200, 200)
        low, high = self._box(case)
        size, found = float(np.linalg.norm(high - low)), []
        axes = [np.linspace(lo, hi, 22) for lo, hi in zip(low, high, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
        for radius in (0.04 * size, 0.07 * size, 0.12 * size):
            votes = np.zeros(len(grid))
            shadows.shadow_votes(p.position[rows], gain, lamp[rows], context.state.lamps, grid, radius, votes)
            for i in np.argsort(votes)[::-1][:2]:
                if votes[i] > 50:
                    found.append((votes[i], {f"centre.{a}": grid[i, k] for k, a in enumerate("xyz")} | {"radius": radius}))
        found.sort(key=lambda f: -f[0])
        return [start for _, start in found[:3]] or False

    def starts(self, case: Case, target: str | None, aux: Any) -> list[dict[str, float]]:
        return aux

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        p, frame = case.pieces, frame_of(case)
        centre, radius = tuple(float(values[f"centre.{a}"]) for a in "xyz"), float(values["radius"])
        lit, seen, light = np.empty_like(p.visible), np.empty(len(p), np.float32), np.empty((len(p), 3), np.float32)
        shadows.sphere_shadow(p.position, p.across, p.down, frame, case.slots, state.lamps, centre, radius, lit)
        state.visible = state.visible * lit
        distance = np.where(p.shape < 0, np.inf, p.distance)
        camera = case.cameras[0]
        angle = 1 / camera.fx if camera.model != "ORTHOGRAPHIC" else 1e-3
        shadows.sphere_in_view(
            eyes(case), angle, sight(case), distance, frame, case.slots, state.lamps, centre, radius, seen, light
        )  # fmt: skip
        state.veil(np.repeat(seen[:, None], 3, 1), light * np.array([values[f"albedo.{c}"] for c in "rgb"]))

    def restored(self, case: Case, target: str | None, context: Context, field: Texture | None) -> Any:
        return None  # its first guesses alone are prepared
