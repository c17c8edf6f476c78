"""What a build did, in numbers: points per filter, errors of the surfaces, coverage, boards, time and memory."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from materials.foundation.files import replacing, write_json

from ..mesh import Mesh
from ..scene_file import Scene
from .cloud import Cloud, path_of
from .stages import Stages
from .surface import distance_to_mesh, is_edge_manifold

NEAR = 15.0  # where a camera sees detail [m]


def measure(scene: Scene, cloud: Cloud, stages: Stages, board_notes: list[dict[str, Any]], held_out: int) -> dict[str, Any]:
    """Return the report of a build as plain values.

    Parameters
    ----------
    scene : Scene
    cloud : Cloud
        Its static cloud; every `held_out`-th point was kept from the surfaces.
    stages : Stages
        As run.
    board_notes : list of dict
        Per frame and instance, as `cardboard.cardboards` gives them, and the `seconds` that the board took.
    """
    held = np.arange(len(cloud.points_world)) % held_out == 0
    path = path_of(scene.recording)
    near = np.ones(len(held), bool)
    if len(path):
        near = cKDTree(path[:, :2]).query(cloud.points_world[:, :2])[0] < NEAR
    surfaces = {}
    for name, mesh, chosen in (("ground", scene.ground, cloud.is_ground), ("environment", scene.environment, ~cloud.is_ground)):
        distance = distance_to_mesh(cloud.points_world[chosen], mesh)
        surfaces[name] = {
            "vertices": len(mesh.vertices),
            "triangles": mesh.num_faces,
            "edge_manifold": is_edge_manifold(mesh),
            "point_to_mesh_m": _errors(distance),
            "held_out_m": _errors(distance[held[chosen]]),
            f"held_out_within_{NEAR:.0f}_m_of_path_m": _errors(distance[(held & near)[chosen]]),
            "seen_share_of_vertices": _share(mesh),
        }
    facing = scene.ground.face_normals()[:, 2]
    surfaces["ground"]["faces_upwards_share"] = round(float((facing > 0).mean()), 6) if len(facing) else 0.0
    methods = [note["method"] for frame in board_notes for note in frame.values()]
    ratio = [note["depth"] / note["sweep_depth"] for frame in board_notes for note in frame.values() if note.get("sweep_depth")]
    seconds = [note["seconds"] for frame in board_notes for note in frame.values()]
    return {
        "name": scene.name,
        "frames": len(scene.recording.frames),
        "points": cloud.counts,
        "surfaces": surfaces,
        "ground_area_m2": round(_area(scene.ground), 1),
        "ground_coverage": _coverage(scene, path),
        "cardboards": {
            "count": len(methods),
            "by_method": {method: methods.count(method) for method in sorted(set(methods))},
            "depth_over_sweep_depth_median": round(float(np.median(ratio)), 4) if ratio else None,
            "milliseconds_each_median": round(1000 * float(np.median(seconds)), 1) if seconds else None,
        },
        "stages": {
            name: {"seconds": round(r.seconds, 1), "peak_MB": r.peak_bytes // 1_000_000, "reused": r.reused}
            for name, r in stages.results.items()
        },
        "seconds": round(sum(r.seconds for r in stages.results.values()), 1),
    }


def write_report(folder: Path, report: dict[str, Any], previews: list[Path]) -> None:
    """Write `report.json` and, to be read, `report.md`."""
    write_json(folder / "report.json", report)
    lines = [f"# Scene `{report['name']}`", "", f"{report['frames']} frames, built in {report['seconds']} s.", "", "## Points", ""]
    lines += ["| step | points |", "|---|---:|"] + [f"| {name} | {count} |" for name, count in report["points"].items()]
    lines += [
        "",
        "## Surfaces",
        "",
        "| surface | triangles | median error [mm] | 95 % [mm] | held out [mm] | 95 % [mm] |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for name, s in report["surfaces"].items():
        numbers = [s["point_to_mesh_m"]["median"], s["point_to_mesh_m"]["p95"], s["held_out_m"]["median"], s["held_out_m"]["p95"]]
        cells = " | ".join("–" if v is None else f"{1000 * v:.1f}" for v in numbers)
        lines.append(f"| {name} | {s['triangles']} | {cells} |")
    lines += [
        "",
        f"Ground: {report['ground_area_m2']} m². Share of the area with a ground mesh, by distance from the path:",
        "",
    ]
    lines += [f"- {name}: {share}" for name, share in report["ground_coverage"].items()]
    boards = report["cardboards"]
    each = f", {boards['milliseconds_each_median']} ms each (median)" if boards["count"] else ""
    lines += ["", "## Moving objects", "", f"{boards['count']} boards: {boards['by_method']}{each}.", ""]
    lines += ["## Stages", "", "| stage | seconds | peak memory so far [MB] |", "|---|---:|---:|"]
    lines += [
        f"| {name} | {s['seconds']}{' (kept)' if s['reused'] else ''} | {s['peak_MB']} |" for name, s in report["stages"].items()
    ]
    lines += ["", "## Pictures", ""] + [f"![{p.stem}](preview/{p.name})" for p in previews]
    with replacing(folder / "report.md") as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _errors(distance: NDArray[np.float64]) -> dict[str, Any]:
    """Return median and 95 % of the distances that are finite, and how many there were."""
    distance = distance[np.isfinite(distance)]
    if len(distance) == 0:
        return {"median": None, "p95": None, "count": 0}
    median, p95 = np.percentile(distance, [50, 95])
    return {"median": round(float(median), 5), "p95": round(float(p95), 5), "count": len(distance)}


def _share(mesh: Mesh) -> float | None:
    """Return the share of vertices whose colour some frame saw."""
    weight = mesh.attributes.get("fill_w")
    return None if weight is None or len(weight) == 0 else round(float((weight > 0).mean()), 4)


def _area(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, i]].astype(np.float64) for i in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def _coverage(scene: Scene, path: NDArray[np.float64]) -> dict[str, float]:
    """Return the share of grid cells with ground within 3, 6 and 12 m of the path."""
    if len(path) == 0:
        return {}
    X, Y = scene.grid.centres()
    fold = max(1, round(0.2 / scene.grid.cell))
    covered = scene.maps["coverage"][::fold, ::fold] > 0
    places = np.column_stack([X[::fold, ::fold].ravel(), Y[::fold, ::fold].ravel()])
    distance = cKDTree(path[:, :2]).query(places)[0].reshape(covered.shape)
    near = {limit: distance < limit for limit in (3, 6, 12)}
    return {f"within {limit} m": round(float(covered[chosen].mean()), 4) for limit, chosen in near.items() if chosen.any()}
