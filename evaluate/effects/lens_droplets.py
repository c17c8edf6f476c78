"""Drops on the glass: in spots fixed to the sensor the picture is turned over, shrunk and blurred."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, label

from scene.simulation import Texture

from ..kernels import drops as kernel
from ..mismatch.case import Case
from ..mismatch.effect import Context, Effect, Parameter, Values
from ..mismatch.formation import State

_MOST = 24
# Radii of drops that are looked for, in shares of the picture's width.
_RADII = (0.018, 0.026, 0.037, 0.053, 0.075)
# Of drops that are not there, one in so many lowers chi-square by g with a chance below exp(-g / 2); the rest is for
# residuals that are not quite noise.
_LEAST_GAIN = 60.0


class LensDroplets(Effect):
    id = "lens_droplets"
    stage = "lens"
    title = "drops on the glass"
    says = "round spots fixed to the sensor show the scene turned over, shrunk or blurred, in all frames"
    taken_for = ("moved_object", "defocus")
    decides = "wipe the glass"
    coordinates = "sensor"
    approximation = 0.2
    on_picture = True
    completes = True

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        unit = case.size[1] / 160
        # At x in a drop about c the picture of c - magnification (x - c) is seen.
        return (
            Parameter("magnification", 1.0, -1.0, 8.0, 0.05),
            Parameter("blur", 1.0 * unit, 0.05 * unit, 12.0 * unit, 0.1 * unit, "px"),
            Parameter("size", 1.0, 0.7, 1.5, 0.02),
            Parameter("transmission", 1.0, 0.2, 1.5, 0.01),
        )

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        """Look for spots where the residual is large in frame after frame, and small around them."""
        if case.num_frames < 3:
            return False
        z2 = np.minimum(context.z**2, 100).mean(axis=3)
        # The median over frames does not fall for what is large in a few of them.
        energy = gaussian_filter(np.median(z2, axis=0), 1.0)
        low = float(np.median(energy))
        high = energy > max(3.0 * low, low + 1.0)
        parts, count = label(high)
        if count == 0 or high.mean() > 0.4:
            return False
        area = np.bincount(parts.ravel(), minlength=count + 1)[1:]
        spots = []
        for i in np.argsort(area)[::-1][:_MOST]:
            if area[i] < 9:
                break
            rows, cols = np.nonzero(parts == i + 1)
            spots.append((cols.mean() + 0.5, rows.mean() + 0.5, float(np.sqrt(area[i] / np.pi)) + 0.5))
        return spots or False

    def completed(self, case: Case, target: str | None, aux: Any, values: Values, without: Context) -> Any:
        """Look for drops that look as those that were found do, wherever they explain most, one after the other."""
        height, width = case.size
        pictures, residual = without.picture, without.residual
        sigma, size = float(values["blur"]), float(values["size"])
        blurred = np.stack([cv2.GaussianBlur(p, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE) for p in pictures])
        looks = float(values["magnification"]), float(values["transmission"])
        free, at = np.ones((height, width)), np.mgrid[:height, :width] + 0.5

        def gains(drops: NDArray[np.float64]) -> NDArray[np.float64]:
            out = np.empty(len(drops))
            kernel.gains(pictures, blurred, residual, without.weight, free, drops, *looks, out)
            return out

        step = max(width / 80, 1.0)
        cx, cy, r = np.meshgrid(np.arange(0, width, step), np.arange(0, height, step), np.array(_RADII) * width, indexing="ij")
        candidates = np.stack([cx.ravel(), cy.ravel(), r.ravel()], axis=1)
        # Those that were found compete with the rest: their places came from what was wrong, not from how a drop looks.
        candidates = np.concatenate([np.array(aux) * [1, 1, size], candidates])
        found: list[tuple[float, float, float]] = []
        gain = gains(candidates)
        while len(found) < _MOST:
            best, most = candidates[np.argmax(gain)], float(gain.max())
            for reach in (0.5 * step, 0.25 * step, 0.12 * step):
                near = np.array([best + reach * np.array(d) for d in np.ndindex(3, 3, 3)]) - reach
                near = near[near[:, 2] > 1]
                own = gains(near)
                best, most = (near[np.argmax(own)], float(own.max())) if own.max() > most else (best, most)
            if most < _LEAST_GAIN:
                break
            found.append((float(best[0]), float(best[1]), float(best[2] / size)))
            # Its rim is taken as well, which it has explained in part.
            free[np.hypot(at[1] - best[0], at[0] - best[1]) < best[2] + 1.5] = 0
            touched = np.hypot(candidates[:, 0] - best[0], candidates[:, 1] - best[1]) < candidates[:, 2] + best[2] + 3
            gain[touched] = gains(candidates[touched])
        return found or aux

    def starts(self, case: Case, target: str | None, aux: Any) -> list[dict[str, float]]:
        return [{"magnification": m} for m in (0.5, 1.5, 3.0, -0.8)]

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        height, width = case.size
        y, x = np.mgrid[:height, :width] + 0.5
        at_x, at_y, mask = x.copy(), y.copy(), np.zeros((height, width))
        for cx, cy, radius in aux:
            r = radius * values["size"]
            d = np.hypot(x - cx, y - cy)
            inside = d < r + 0.5
            at_x[inside] = cx - values["magnification"] * (x[inside] - cx)
            at_y[inside] = cy - values["magnification"] * (y[inside] - cy)
            mask = np.maximum(mask, np.clip(r - d + 0.5, 0, 1))
        at = (np.clip(at_x, 0, width) - 0.5).astype(np.float32), (np.clip(at_y, 0, height) - 0.5).astype(np.float32)
        share, sigma, level = mask[..., None].astype(np.float32), float(values["blur"]), np.float32(values["transmission"])

        def through_drops(pictures):
            out = np.empty_like(pictures)
            for f, p in enumerate(pictures):
                seen = cv2.remap(p, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
                seen = cv2.GaussianBlur(seen, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)
                out[f] = p + share * (level * seen - p)
            return out

        state.lens.append(through_drops)

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        return {"drops": {"value": len(aux), "unit": "1"}}

    def stored(self, case: Case, target: str | None, aux: Any) -> Texture | None:
        """Return the spots as rows of (column, row, radius) [px]."""
        return np.array(aux, np.float32)[:, None, :]

    def restored(self, case: Case, target: str | None, context: Context, field: Texture | None) -> Any:
        assert field is not None
        return [tuple(float(x) for x in spot) for spot in field.reshape(-1, field.shape[-1])[:, :3]]
