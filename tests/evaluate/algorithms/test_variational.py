"""Known motions are found to a tenth of a pixel, the energy never rises, and the linear solver solves its system."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numba
import numpy as np
import pytest
from scipy.sparse import bmat, coo_matrix
from scipy.sparse.linalg import spsolve

from evaluate.algorithms import estimate as estimate_by_name
from evaluate.algorithms.variational import BROX, HORN_SCHUNCK, PAPENBERG, Step, estimate
from evaluate.flow_metrics import score
from evaluate.kernels import variational as kernel
from materials.foundation.errors import InputError
from scene.flow_files import as_flow, read_flow
from scene.images import read_raw

from .textures import moved_pair, rotation

NAMES = {"horn-schunck": HORN_SCHUNCK, "papenberg": PAPENBERG, "brox": BROX}
MOTIONS = {
    "translation": (np.eye(2), np.array([3.3, -1.7])),
    "far translation": (np.eye(2), np.array([-9.4, 6.2])),
    "rotation": (rotation(4.0), np.array([0.0, 0.0])),
    "zoom": (1.04 * np.eye(2), np.array([0.5, 0.5])),
}


def inner_error(flow: np.ndarray, truth: np.ndarray) -> float:
    """Return the mean end-point error over what stays in the picture, 4 px from the border that nothing constrains."""
    height, width = truth.shape[:2]
    y, x = np.mgrid[:height, :width]
    there_x, there_y = x + truth[..., 0], y + truth[..., 1]
    kept = (there_x > 4) & (there_x < width - 5) & (there_y > 4) & (there_y < height - 5)
    kept[:4] = kept[-4:] = kept[:, :4] = kept[:, -4:] = False
    return float(np.hypot(*(flow - truth)[kept].T).mean())


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("motion", MOTIONS)
def test_known_motions_are_found_to_a_tenth_of_a_pixel(name: str, motion: str):
    first, second, truth = moved_pair(*MOTIONS[motion])
    # Nothing would be found without looking: these motions are 1.7 to 11 px long.
    assert np.hypot(*truth.reshape(-1, 2).T).mean() > 1.5
    assert inner_error(estimate_by_name(first, second, name), truth) < 0.1


@pytest.mark.parametrize("name", NAMES)
def test_the_energy_never_rises_and_falls_by_a_lot(name: str):
    first, second, _ = moved_pair(*MOTIONS["rotation"])
    steps: list[Step] = []
    estimate(first, second, NAMES[name], steps)
    assert len(steps) > 4 and {s.level for s in steps} >= {0, 1}
    assert all(s.after <= s.before for s in steps)
    for a, b in pairwise(steps):
        # Within a level each step begins where the one before ended.
        assert a.level != b.level or b.before == pytest.approx(a.after, rel=1e-12)
    coarsest = [s for s in steps if s.level == max(t.level for t in steps)]
    assert coarsest[-1].after < 0.5 * coarsest[0].before


def test_nothing_moves_between_equal_pictures():
    first, _, _ = moved_pair(np.eye(2), np.zeros(2))
    for settings in NAMES.values():
        np.testing.assert_array_equal(estimate(first, first, settings), 0)


def system(height: int, width: int, seed: int = 0):
    """Return a random system as `relax` takes it, and its solution by a direct solver."""
    rng = np.random.default_rng(seed)
    gx, gy = rng.normal(0, 3, (2, height, width))
    d11, d12, d22 = gx * gx, gx * gy, gy * gy
    residual = rng.normal(0, 5, (height, width))
    b1, b2 = -gx * residual, -gy * residual
    right, below = rng.uniform(0.5, 20, (2, height, width))
    u, v = rng.normal(0, 1, (2, height, width))
    n = height * width
    index = np.arange(n).reshape(height, width)
    p = np.concatenate([index[:, :-1].ravel(), index[:-1].ravel()])
    q = np.concatenate([index[:, 1:].ravel(), index[1:].ravel()])
    weights = np.concatenate([right[:, :-1].ravel(), below[:-1].ravel()])
    entries = np.concatenate([weights, weights, -weights, -weights])
    laplacian = coo_matrix((entries, (np.concatenate([p, q, p, q]), np.concatenate([p, q, q, p]))), (n, n)).tocsr()
    rows = np.arange(n)
    data = coo_matrix(
        (
            np.concatenate([d11.ravel(), d12.ravel(), d12.ravel(), d22.ravel()]),
            (np.concatenate([rows, rows, rows + n, rows + n]), np.concatenate([rows, rows + n, rows, rows + n])),
        ),
        (2 * n, 2 * n),
    )
    zero = coo_matrix((n, n))
    A = (data + bmat([[laplacian, zero], [zero, laplacian]])).tocsr()
    rhs = np.concatenate([b1.ravel() - laplacian @ u.ravel(), b2.ravel() - laplacian @ v.ravel()])
    return (d11, d12, d22, right, below), (b1, b2, right, below, u, v), A, rhs


def relaxed(parts, arrays, rounds: int, x: np.ndarray | None = None) -> np.ndarray:
    shape = parts[0].shape
    du, dv = np.zeros(shape), np.zeros(shape)
    if x is not None:
        du, dv = (c.reshape(shape).copy() for c in np.split(x, 2))
    inverse = tuple(np.empty(shape) for _ in range(3))
    kernel.invert(*parts, *inverse)
    kernel.relax(*inverse, *arrays, du, dv, 1.7, 4, rounds)
    return np.concatenate([du.ravel(), dv.ravel()])


def test_relaxation_solves_the_system():
    # 70 rows are three strips, the last one short.
    parts, arrays, A, rhs = system(70, 23)
    solution = spsolve(A, rhs)
    np.testing.assert_allclose(relaxed(parts, arrays, 200), solution, atol=1e-8)


def test_every_round_lowers_the_quadratic_energy():
    parts, arrays, A, rhs = system(70, 23, seed=1)
    x = np.zeros(len(rhs))
    energies = [0.0]
    for _ in range(8):
        x = relaxed(parts, arrays, 1, x)
        energies.append(float(x @ (A @ x) - 2 * rhs @ x))
    assert (np.diff(energies) < 0).all()


def test_the_number_of_threads_changes_no_bit(thread_counts):
    first, second, _ = moved_pair(*MOTIONS["zoom"])
    flows = []
    for threads in thread_counts:
        numba.set_num_threads(threads)
        flows.append(estimate(first, second, replace(BROX, levels=2, warps=2)))
    np.testing.assert_array_equal(*flows)


def test_sampling_interpolates_cubics_and_holds_the_border():
    y, x = np.mgrid[:12, :14].astype(float)
    stack = np.stack([0.01 * x * x - 0.3 * y + x * y / 50])
    out, inside = np.empty_like(stack), np.empty(x.shape, bool)
    kernel.sample(stack, np.full(x.shape, 0.3), np.full(x.shape, -0.45), out, inside)
    wanted = 0.01 * (x + 0.3) ** 2 - 0.3 * (y - 0.45) + (x + 0.3) * (y - 0.45) / 50
    # Keys' cubic reproduces quadratics away from the border.
    np.testing.assert_allclose(out[0][2:-2, 2:-2], wanted[2:-2, 2:-2], atol=1e-12)
    assert not inside[0].any() and not inside[:, -1].any() and inside[1:, :-1].all()
    kernel.sample(stack, np.full(x.shape, 99.0), np.zeros(x.shape), out, inside)
    np.testing.assert_allclose(out[0], np.repeat(stack[0][:, -1:], 14, axis=1), atol=1e-12)


def test_highlights_above_white_count_for_those_who_see_them():
    # A pattern three times as bright as white moves over a white ground: clipped to 8 bits, it is gone.
    first, second, truth = moved_pair(*MOTIONS["translation"])
    linear = [(1 + 2 * image / 255).astype(np.float32) for image in (first, second)]
    assert all((np.clip(image, 0, 1) == 1).all() for image in linear)
    clipped = [np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8) for image in linear]
    length = float(np.hypot(*truth[0, 0]))
    assert inner_error(estimate(*clipped, BROX), truth) == pytest.approx(length, rel=1e-6)
    # A third of the contrast of the pictures above, after the curve: the bound is a tenth of the motion, not of a pixel.
    assert inner_error(estimate(*linear, BROX), truth) < 0.1 * length


def test_rubberwhale_is_found_better_than_by_deepflow(shared_data: Path):
    folder = shared_data / "middlebury_rubberwhale"
    pair = [read_raw(folder / f"frame{i}.png") for i in (10, 11)]
    truth = read_flow(folder / "flow10.flo")
    found = score(as_flow(estimate(pair[0], pair[1], BROX)), truth)
    # OpenCV's DIS has 0.225 px here, its DeepFlow 0.121 px; ours had 0.111 px when it was written.
    assert found.epe is not None and found.epe < 0.121


def test_pictures_that_do_not_fit_are_refused():
    first, second, _ = moved_pair(*MOTIONS["zoom"])
    with pytest.raises(InputError, match="the two pictures must have one size"):
        estimate(first, second[:-1])
    with pytest.raises(InputError, match="one kind of numbers"):
        estimate(first, second.astype(np.float32))
    with pytest.raises(InputError, match="at least 16 pixels"):
        estimate(first[:9], second[:9])
    with pytest.raises(InputError, match="must hold light"):
        estimate(np.zeros((20, 20), np.float32), np.zeros((20, 20), np.float32))
    with pytest.raises(InputError, match="the pictures must be finite"):
        estimate(np.full((20, 20), np.nan, np.float32), np.ones((20, 20), np.float32))
