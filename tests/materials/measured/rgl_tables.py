"""A tensor file as the RGL database has them, of an invented material."""

from __future__ import annotations

import numpy as np

from materials.measured.tensor_file import write_tensor_file


def write_rgl(path, isotropic: bool = True, jacobian: int = 0, flat: bool = False) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(4)
    num_phi, num_theta = (1, 4) if isotropic else (5, 3)
    lead = (num_phi, num_theta)
    smooth = np.linspace(0, 1, 9)
    fields = {
        "description": np.frombuffer(b"invented", np.uint8),
        "phi_i": np.zeros(1, np.float32) if isotropic else np.linspace(-np.pi, np.pi, num_phi, dtype=np.float32),
        "theta_i": np.linspace(0, 1.4, num_theta, dtype=np.float32),
        "ndf": np.float32(1 + 0.5 * np.outer(np.ones(9) if isotropic else smooth, smooth)),
        "sigma": np.float32(0.4 + 0.2 * np.outer(np.ones(9) if isotropic else smooth, 1 - smooth)),
        "vndf": np.ones((*lead, 6, 7), np.float32) if flat else rng.uniform(0.2, 2, (*lead, 6, 7)).astype(np.float32),
        "rgb": rng.uniform(0.1, 1, (*lead, 3, 8, 8)).astype(np.float32),
        "luminance": rng.uniform(0.1, 1, (*lead, 8, 8)).astype(np.float32),
        "jacobian": np.array([jacobian], np.uint8),
    }
    write_tensor_file(path, fields)
    return fields
