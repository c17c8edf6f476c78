"""A camera that moved while the shutter was open."""

from __future__ import annotations

from typing import Any

import numpy as np

from scene.simulation import Texture

from ..mismatch.case import Case, Floats
from ..mismatch.effect import Context, Values
from ..mismatch.formation import State
from ..mismatch.warp import TWIST, moved, twist_flow, typical_distance
from .pose_error import PoseError

_STEPS = 7


class MotionBlur(PoseError):
    id = "motion_blur"
    stage = "lens"
    title = "motion blur"
    says = "each frame is blurred along the way its camera went"
    taken_for = ("defocus", "pose_error")
    decides = "shorten the exposure"
    coordinates = "frame"
    approximation = 0.1
    settles = False
    per = "frame"

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        """Find a first guess: blur is even in the motion, so that nothing leads away from standing still.

        To second order a box of motion v adds 1/24 (v . grad)² I; with v a combination of six flows it is linear in the
        products of their shares, whose matrix has the motion for its leading eigenvector.
        """
        # A unit of each share moves the picture by about a pixel.
        scale = np.array([1, 1, 1, *[typical_distance(case)] * 3]) / case.cameras[0].fx
        guess = self.first_guess(case, context, twist_flow(case) * scale[:, None, None, None, None].astype(np.float32))
        return guess if guess is False else guess * scale

    def first_guess(self, case: Case, context: Context, basis: Floats) -> Any:
        """Return the shares (F, K) of the flows of a basis (K, F, H, W, 2) in each frame's motion; False if there is none."""
        size = len(basis)
        out = np.zeros((case.num_frames, size))
        pairs = [(i, j) for i in range(size) for j in range(i, size)]
        for f in range(case.num_frames):
            L = context.picture[f]
            gy, gx = np.gradient(L, axis=(0, 1))
            gyy, _ = np.gradient(gy, axis=(0, 1))
            gxy, gxx = np.gradient(gx, axis=(0, 1))
            B = basis[:, f]
            root = np.sqrt(context.weight[f])
            columns = []
            for i, j in pairs:
                xx, yy = B[i, ..., 0] * B[j, ..., 0], B[i, ..., 1] * B[j, ..., 1]
                xy = B[i, ..., 0] * B[j, ..., 1] + B[i, ..., 1] * B[j, ..., 0]
                d = (xx[..., None] * gxx + xy[..., None] * gxy + yy[..., None] * gyy) / 24
                columns.append((root * d * (1.0 if i == j else 2.0)).ravel()[::3])
            A = np.array(columns).T
            H = A.T @ A
            x = np.linalg.solve(H + 1e-2 * np.eye(len(H)) * np.trace(H) / len(H), A.T @ (root * context.residual[f]).ravel()[::3])
            S = np.zeros((size, size))
            for (i, j), value in zip(pairs, x, strict=True):
                S[i, j] = S[j, i] = value
            values, vectors = np.linalg.eigh(S)
            if values[-1] > 0:
                out[f] = vectors[:, -1] * np.sqrt(values[-1])
        return out if np.any(out) else False

    def starts(self, case: Case, target: str | None, aux: Any) -> list[dict[str, Any]]:
        return [{name: aux[:, i] for i, name in enumerate(TWIST)}]

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        twist = np.stack([values[n] for n in TWIST], axis=1).astype(np.float32)
        basis = twist_flow(case)

        def smear(pictures):
            out = np.zeros_like(pictures)
            for f in range(len(pictures)):
                flow = np.tensordot(twist[f], basis[:, f], 1)
                for t in (np.arange(_STEPS) + 0.5) / _STEPS - 0.5:
                    out[f] += moved(pictures[f], flow * np.float32(t)) / _STEPS
            return out

        state.lens.append(smear)

    def restored(self, case: Case, target: str | None, context: Context, field: Texture | None) -> Any:
        return None  # its first guess alone is prepared
