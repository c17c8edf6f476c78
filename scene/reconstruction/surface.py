"""Points to triangles: normals, screened Poisson for what stands around, a height field for the ground."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from materials.foundation.errors import InputError
from materials.foundation.progress import stage

from ..mesh import Mesh
from .build_settings import HeightFieldSettings, SurfaceSettings
from .ground_mesh import edge_components, triangulate
from .height_field import HeightField, fit_height_field
from .mesh_rays import MeshRays

Floats = NDArray[np.floating]


def normals(points_world: Floats, *, up: bool = False, towards: Floats | None = None, neighbours: int = 20) -> NDArray[np.float64]:
    """Return unit normals (N, 3) from nearest neighbours, turned upwards or `towards` places (N, 3).

    Raises
    ------
    InputError
        If there are fewer than 3 points.
    """
    import open3d

    if len(points_world) < 3:
        raise InputError("hold at least 3 points", got=len(points_world), key="points_world")
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(np.asarray(points_world, dtype=np.float64)))
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(neighbours))
    n = np.asarray(cloud.normals).copy()
    reference = np.broadcast_to((0.0, 0.0, 1.0), n.shape) if up or towards is None else np.asarray(towards) - points_world
    n[np.einsum("ij,ij->i", n, reference) < 0] *= -1
    return n


def point_spacing(points_world: Floats, sample: int = 20000) -> float:
    """Return the median distance to the nearest neighbour [m]."""
    points = np.asarray(points_world, dtype=np.float64)
    some = points[:: max(1, len(points) // sample)]
    return float(np.median(cKDTree(points).query(some, k=2)[0][:, 1]))


def poisson_depth(points_world: Floats, deepest: int, finest: float = 0.0) -> int:
    """Return the octree depth at which a cell has one to two median point spacings, between 6 and `deepest`.

    No cell is finer than `finest` [m].

    A full survey cloud (1 cm over 100 m) gets the 13 and 12 of the thesis; finer cells than points only cost time.
    """
    extent = float(np.ptp(points_world, axis=0).max()) * 1.1
    return int(np.clip(np.floor(np.log2(max(extent / max(point_spacing(points_world), finest, 1e-4), 2.0))), 6, deepest))


def reconstruct_ground(
    points_world: Floats, path_world: Floats, settings: SurfaceSettings, field: HeightFieldSettings
) -> tuple[Mesh, HeightField | None]:
    """Return the ground mesh, upwards, and the height field behind it (None for Poisson)."""
    if settings.ground_method == "height-field":
        with stage("ground mesh"):
            heights = fit_height_field(points_world, path_world, field)
            return triangulate(heights), heights
    n = normals(points_world, up=True, neighbours=settings.normal_neighbours)
    depth = settings.ground_depth or poisson_depth(points_world, 13)
    return _poisson_trimmed(points_world, n, depth, settings), None


def reconstruct_environment(points_world: Floats, sensors_world: Floats, settings: SurfaceSettings | None = None) -> Mesh:
    """Return a mesh of what stands around, by screened Poisson, facing the sensors.

    Too few points for a surface give an empty mesh.

    Parameters
    ----------
    points_world, sensors_world : (N, 3) float
        Points and where each was measured from [m].
    """
    settings = settings or SurfaceSettings()
    if len(points_world) < 100:
        return Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32), np.zeros((0, 3), np.float32))
    with stage("environment mesh"):
        n = normals(points_world, towards=sensors_world, neighbours=settings.normal_neighbours)
        depth = settings.environment_depth or poisson_depth(points_world, 12, settings.environment_cell)
        return _poisson_trimmed(points_world, n, depth, settings)


def _poisson_trimmed(points: Floats, n: Floats, depth: int, settings: SurfaceSettings) -> Mesh:
    mesh, density = screened_poisson(points, n, depth)
    return trim(mesh, density, points, n, settings)


def screened_poisson(
    points_world: Floats, n: Floats, depth: int, *, library: str = "open3d", threads: int = 1
) -> tuple[Mesh, NDArray[np.float64]]:
    """Return the closed Poisson surface and, per vertex, the log2 of the density of points that support it.

    Parameters
    ----------
    points_world, n : (N, 3) float
        Points [m] and oriented unit normals.
    depth : int
        Octree depth.
    library : {"open3d", "pymeshlab"}
        Both wrap Kazhdan's code and are repeatable on one thread. Open3D is the default: on a street of 155 000
        environment points (depth 11, one thread) it took 23 s where pymeshlab took 34, with a median distance of
        held-out points of 27 mm against 29.
    """
    if library == "open3d":
        import open3d

        cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(np.asarray(points_world, np.float64)))
        cloud.normals = open3d.utility.Vector3dVector(np.asarray(n, np.float64))
        raw, density = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
            cloud, depth=depth, linear_fit=False, n_threads=threads
        )
        vertices, faces, support = np.asarray(raw.vertices), np.asarray(raw.triangles), np.asarray(density)
    else:
        import pymeshlab

        work = pymeshlab.MeshSet(verbose=False)
        work.add_mesh(
            pymeshlab.Mesh(vertex_matrix=np.asarray(points_world, np.float64), v_normals_matrix=np.asarray(n, np.float64))
        )
        work.generate_surface_reconstruction_screened_poisson(depth=depth, preclean=True, threads=threads)
        result = work.current_mesh()
        vertices, faces, support = result.vertex_matrix(), result.face_matrix(), result.vertex_scalar_array()
    return Mesh(vertices.astype(np.float32), faces.astype(np.uint32)), np.array(support, dtype=np.float64)


def trim(mesh: Mesh, density: Floats, points_world: Floats, n: Floats, settings: SurfaceSettings | None = None) -> Mesh:
    """Cut off what no points support, drop crumbs, and keep a manifold that faces as the points do.

    A face goes if its centre or a corner lies further from all points than `trim_distance` times the points' spacing
    there (at least 0.15 m): Poisson closes every gap with a membrane, and none was measured.
    """
    settings = settings or SurfaceSettings()
    points = np.asarray(points_world, dtype=np.float64)
    tree = cKDTree(points)
    spacing = tree.query(points, k=6, workers=-1)[0][:, -1]
    away, nearest = tree.query(mesh.vertices.astype(np.float64), workers=-1)
    allowed = np.clip(settings.trim_distance * spacing[nearest] / 2, 0.15, 1.0)
    good = (away <= allowed) & (density > np.quantile(density, settings.trim_density) if len(density) else True)
    faces = mesh.faces[good[mesh.faces].all(axis=1)]
    mesh = _compact(mesh.vertices, faces)
    for _ in range(2):
        mesh = _manifold(mesh)
        if mesh.num_faces == 0:
            break
        piece = edge_components(mesh)
        keep = (np.bincount(piece) >= settings.smallest_piece)[piece]
        mesh = _compact(mesh.vertices, mesh.faces[keep])
    return _facing(mesh, tree, n).with_smooth_normals()


def _facing(mesh: Mesh, tree: cKDTree, n: Floats) -> Mesh:
    """Turn each piece so that it faces as the majority of its points."""
    if mesh.num_faces == 0:
        return mesh
    centres = mesh.vertices[mesh.faces].mean(axis=1, dtype=np.float64)
    agrees = np.einsum("ij,ij->i", mesh.face_normals(), n[tree.query(centres, workers=-1)[1]])
    piece = edge_components(mesh)
    turned = (np.bincount(piece, weights=agrees) < 0)[piece]
    faces = mesh.faces.copy()
    faces[turned] = faces[turned][:, ::-1]
    return Mesh(mesh.vertices, faces)


def _compact(vertices: Floats, faces: NDArray[np.uint32]) -> Mesh:
    used, new = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used].astype(np.float32), new.reshape(-1, 3).astype(np.uint32))


def _manifold(mesh: Mesh) -> Mesh:
    """Drop faces without area, and of faces that run along an edge in the same direction all but the largest."""
    vertices, faces = mesh.vertices, mesh.faces
    a, b, c = (vertices[faces[:, i]].astype(np.float64) for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    faces, area = faces[area > 0], area[area > 0]
    while len(faces):
        f = faces.astype(np.int64)
        start, end = f.ravel(), f[:, [1, 2, 0]].ravel()
        key = start * len(vertices) + end
        face = np.repeat(np.arange(len(f)), 3)
        order = np.lexsort((face, -area[face], key))
        again = key[order][1:] == key[order][:-1]
        if not again.any():
            break
        keep = np.ones(len(f), bool)
        keep[face[order[1:][again]]] = False
        faces, area = faces[keep], area[keep]
    return _compact(vertices, faces)


def is_edge_manifold(mesh: Mesh) -> bool:
    """Return whether no edge belongs to more than two faces, and neighbours are wound alike."""
    faces = mesh.faces.astype(np.int64)
    directed = np.column_stack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).reshape(-1, 2)
    key = directed[:, 0] * (int(faces.max(initial=0)) + 1) + directed[:, 1]
    # Wound alike, two neighbours run along their edge in opposite directions: no directed edge may come twice.
    return len(np.unique(key)) == len(key)


def distance_to_mesh(points_world: Floats, mesh: Mesh) -> NDArray[np.float64]:
    """Return the distance (N,) of points from the nearest place of a mesh [m]; infinite if it is empty."""
    if mesh.num_faces == 0:
        return np.full(len(points_world), np.inf)
    return MeshRays(mesh).distance(points_world)
