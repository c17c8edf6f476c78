"""Seconds per wet frame at equal error against Blender Cycles: the ground's gloss (eq 6.10) of one frame.

Both trace the same meshes under the same picture, roughness, index and normals, with the same number of bounces, two
threads, each with its own best sampler and without a denoiser. Small differences of modelling are not noise, so each is
measured against a converged image of its own, and the two converged images against each other.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from materials.foundation.files import make_folder, replacing
from scene.images import read_exr
from scene.scene_file import Scene, read_scene
from scene.wetting.water import water_level
from transport.augment import AugmentSettings, separate_frame
from transport.kernels.wet import WetGround
from transport.projected_world import ProjectedFrame, project_frame
from transport.separate import Separation, trace_specular, water_normals
from transport.wet import wet_frame

from .cycles_export import export_frame
from .peers import blender_python
from .report import Report
from .timing import paired

# Another scene (a folder of scene-build) and other numbers may be asked for; the defaults take some 20 minutes.
_SCENE, _SAMPLES, _RUNS = "MENISCUS_BENCH_SCENE", "MENISCUS_BENCH_SAMPLES", "MENISCUS_BENCH_RUNS"
# The references take this many times the samples: what they add to an error is then the same share for both.
_CONVERGED = 16
_WETNESS, _BOUNCES, _SEED = 1.0, 3, 1000


class Cycles:
    """Blender as a process that keeps its scene."""

    def __init__(self, python: Path, frame: Path, folder: Path) -> None:
        self.folder = folder
        script = Path(__file__).with_name("cycles_scene.py")
        self._errors = (folder / "cycles.log").open("w")
        command = [str(python), str(script), str(frame)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors, text=True)
        self.build_seconds = self._answer()["seconds"]

    def render(self, samples: int, seed: int = 0) -> tuple[NDArray[np.float32], dict[str, float]]:
        """Return the picture (H, W, 3) and the time it took, without that of reading it here."""
        file = self.folder / "cycles.exr"
        assert self._process.stdin is not None
        self._process.stdin.write(f"{samples} {seed} {file}\n")
        self._process.stdin.flush()
        answer = self._answer()
        channels = read_exr(file)
        return np.stack([channels[c] for c in "RGB"], axis=-1), answer

    def close(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()
        self._errors.close()

    def _answer(self) -> dict[str, float]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"Blender ended early; see {self._errors.name}")
        return json.loads(line)


@dataclass(frozen=True)
class Setup:
    """One frame ready to be wetted."""

    frame: ProjectedFrame
    separation: Separation
    ground: WetGround
    water: NDArray[np.float32]
    wanted: NDArray[np.bool_]

    def specular(self, samples: int, seed: int = 0) -> NDArray[np.float32]:
        """Return the ground's gloss (H, W, 3) as our kernels trace it."""
        return trace_specular(self.frame, self.ground, self.separation.diffuse, self.wanted, samples, seed, _BOUNCES).specular

    def relative_error(self, image: NDArray[np.float32], reference: NDArray[np.float32]) -> float:
        """Return the relative mean squared error over the ground; a tenth of the mean keeps black from dividing."""
        a, b = image[self.wanted].astype(np.float64), reference[self.wanted].astype(np.float64)
        floor = 0.1 * b.mean()
        return float((((a - b) ** 2).mean(axis=1) / (b.mean(axis=1) ** 2 + floor**2)).mean())


def prepare(scene: Scene, index: int, samples: int) -> Setup:
    """Take a frame apart as `augment` does, and put all the water on it."""
    frame = project_frame(scene, index)
    normals = water_normals(scene.maps["height"], scene.maps["coverage"], scene.grid.cell)
    separation = separate_frame(frame, scene, normals, AugmentSettings(samples=samples, bounces=_BOUNCES))
    water = np.clip(water_level(scene.maps, scene.grid, _WETNESS), 0, 1).astype(np.float32)
    ground = separation.ground._replace(water=np.ascontiguousarray(water))
    return Setup(frame, separation, ground, water, separation.wanted & (separation.share > 0))


def run(report: Report) -> None:
    """Measure and report; pictures of both go to `bench/` beside the report."""
    folder = make_folder(report.folder / "bench")
    samples, runs = int(os.environ.get(_SAMPLES, "64")), int(os.environ.get(_RUNS, "5"))
    python = blender_python()
    scene_folder = _scene(folder)
    scene = read_scene(scene_folder)
    index = len(scene.recording.frames) // 2
    setup = prepare(scene, index, samples)
    setup.specular(1)
    exported = folder / "frame.npz"
    export_frame(exported, setup.frame, setup.ground, setup.separation.diffuse, setup.wanted, _BOUNCES)
    cycles = Cycles(python, exported, folder)
    try:
        first = cycles.render(1)[1]["seconds"]
        _measure(report, folder, setup, cycles, samples, runs)
        peak = cycles.render(1)[1]["peak_mib"]
    finally:
        cycles.close()
    _cold(report, scene_folder, scene.recording.frames[index].name, index, python, exported, samples)
    ours = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    report.figure(
        name="wet frame: peak memory, the whole benchmark in one process", ours=ours, peer="Cycles 4.5", theirs=peak, unit="MiB"
    )
    print(f"Cycles: scene built in {cycles.build_seconds:.1f} s, first picture with its BVH {first:.1f} s", file=sys.stderr)


def _measure(report: Report, folder: Path, setup: Setup, cycles: Cycles, samples: int, runs: int) -> None:
    converged = setup.specular(_CONVERGED * samples, _SEED)
    their_converged, _ = cycles.render(_CONVERGED * samples, _SEED)
    target = setup.relative_error(cycles.render(samples)[0], their_converged)
    # Errors fall as a power of the samples; from two counts ours is known between them.
    counts = (max(samples // 2, 1), 2 * samples)
    errors = [setup.relative_error(setup.specular(n), converged) for n in counts]
    slope = np.log(errors[1] / errors[0]) / np.log(counts[1] / counts[0])
    needed = max(int(np.ceil(counts[0] * (target / errors[0]) ** (1 / slope))), 1)
    reached = setup.relative_error(setup.specular(needed), converged)
    cycles_cpu: list[float] = []
    our_cpu: list[float] = []

    def ours() -> None:
        before = time.process_time()
        setup.specular(needed)
        our_cpu.append(time.process_time() - before)

    def theirs() -> None:
        cycles_cpu.append(cycles.render(samples)[1]["cpu_seconds"])

    pair = paired(ours, theirs, runs)
    title = f"wet gloss of a frame, {setup.wanted.shape[1]} x {setup.wanted.shape[0]}, {needed} and {samples} samples"
    add = {"peer": "Cycles 4.5", "error_reached": max(reached, target)}
    report.figure(name=title, ours=pair.ours, theirs=pair.theirs, unit="s", **add)
    cpu = float(np.median(our_cpu[1:])), float(np.median(cycles_cpu[1:]))
    report.figure(name="  the same, time of both processors", ours=cpu[0], theirs=cpu[1], unit="s", **add)
    whole = _seconds(lambda: wet_frame(setup.frame, setup.separation, setup.water, 0, _BOUNCES))
    report.figure(name=f"  whole wet frame once the dry one is separated, {samples} samples", ours=whole, unit="s")
    difference = setup.relative_error(their_converged, converged)
    report.figure(name="  relative error between the two converged pictures", ours=difference, unit="relMSE")
    _show(folder / "cycles.png", setup.wanted, converged, their_converged)


def _cold(report: Report, scene: Path, name: str, index: int, python: Path, exported: Path, samples: int) -> None:
    """Compare from the start of a process to the file: ours reads meshes, traces dry and wet, and writes the picture."""
    with tempfile.TemporaryDirectory() as out:
        program = "import sys; from transport.cli import main; sys.exit(main())"
        command = [sys.executable, "-c", program, str(scene), "-o", out, "--wetness", str(_WETNESS)]
        command += ["--frames", str(index), "--samples", str(samples), "--no-layers", "--no-labels"]
        ours = _seconds(lambda: subprocess.run(command, check=True, capture_output=True))
        if not list(Path(out).glob(f"**/image/{name}.*")):
            raise RuntimeError(f"augment wrote no picture of frame {name}")

        def theirs() -> None:
            cycles = Cycles(python, exported, Path(out))
            # Dry and wet, as ours.
            cycles.render(samples)
            cycles.render(samples)
            cycles.close()

        report.figure(
            name=f"wet frame {name} from process start to file, {samples} samples",
            ours=ours,
            peer="Cycles 4.5, dry and wet layer",
            theirs=_seconds(theirs),
            unit="s",
        )


def _seconds(function) -> float:
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def _scene(folder: Path) -> Path:
    """Return a scene: the one asked for, else the built-in street at KITTI's size, built once."""
    if _SCENE in os.environ:
        return Path(os.environ[_SCENE])
    target = folder / "street" / "scene"
    if not (target / "scene.json").exists():
        from scene.reconstruction.build import build
        from scene.reconstruction.build_settings import BuildSettings
        from scene.street import StreetSettings, street
        from transport.photograph import PhotographSettings, photograph

        world = street(StreetSettings(frames=2, width=1242, height=375, fov_deg=80.0))
        recording = photograph(world, folder / "street" / "recording", PhotographSettings(samples=16))
        build(recording, target, BuildSettings())
    return target


def _show(file: Path, wanted: NDArray[np.bool_], ours: NDArray[np.float32], theirs: NDArray[np.float32]) -> None:
    """Write both converged pictures and their difference (grey is none) below each other."""
    rows = np.flatnonzero(wanted.any(axis=1))
    shown = [(255 * np.clip(x, 0, 1) ** (1 / 2.2)).astype(np.uint8) for x in (ours, theirs)]
    shown.append(np.clip(128 + 512 * (theirs - ours), 0, 255).astype(np.uint8))
    picture = np.vstack([x[rows[0] : rows[-1] + 1] for x in shown])
    with replacing(file) as temporary:
        cv2.imwrite(str(temporary), np.ascontiguousarray(picture[..., ::-1]))
