"""The world as compiled kernels see it: named tuples of arrays, and where each value stands in their rows."""

from typing import Any, NamedTuple

# Columns of WorldArrays.material_values.
ALBEDO, SPECULAR_SCALE, ETA, ALPHA_U, ALPHA_V, EMISSION = 0, 3, 4, 5, 6, 7
FILM_COVERAGE, FILM_THICKNESS, FILM_ETA, FILM_ALPHA, FILM_SIGMA_A, FILM_LEVEL = 10, 11, 12, 13, 14, 17
TANGENT_COS, TANGENT_SIN = 18, 19
# EMISSION_MEAN is the mean over channels and texture; ONE_SIDED and BUMP_SCALE belong to any kind.
EMISSION_MEAN, ONE_SIDED, BUMP_SCALE = 20, 21, 22
MORE = 23  # `materials.kernels.kinds.NUM_MORE` of them
NUM_VALUES = 33
# Columns of WorldArrays.material_textures; -1 is none.
ALBEDO_TEXTURE, ALPHA_TEXTURE, NORMAL_TEXTURE, OPACITY_TEXTURE, COVERAGE_TEXTURE, THICKNESS_TEXTURE = 0, 1, 2, 3, 4, 5
TINT_TEXTURE, EMISSION_TEXTURE, BUMP_TEXTURE = 6, 7, 8
NUM_TEXTURES = 9
# Columns of LightArrays.suns and .points. SUN_POWER is radiance times solid angle: the irradiance, but for the cosine over
# the disc.
SUN_DIRECTION, SUN_POWER, SUN_COS, SUN_SOLID_ANGLE = 0, 3, 6, 7
POINT_POSITION, POINT_INTENSITY = 0, 3
# Columns of LightArrays.emitters. A sphere has its centre for a corner; uv are those of the corner and their changes along
# the edges.
TRIANGLE, SPHERE = 0.0, 1.0
EMITTER_KIND, EMITTER_CORNER, EMITTER_EDGE1, EMITTER_EDGE2, EMITTER_RADIANCE = 0, 1, 4, 7, 10
EMITTER_UV, EMITTER_TEXTURE, EMITTER_ONE_SIDED, EMITTER_RADIUS = 13, 19, 20, 21
NUM_EMITTER_VALUES = 22


class WorldArrays(NamedTuple):
    """Geometry and materials; faces count static ones first.

    `texels` holds all textures one after the other, row by row; `texture_info` their (offset, width, height, channels).
    """

    static_scene: int
    dynamic_scene: int
    num_static_faces: int
    has_cutouts: bool
    vertices: Any  # (V, 3) float32
    faces: Any  # (F, 3) uint32
    normals: Any  # (V, 3) float32
    uv: Any  # (V, 2) float32
    face_shape: Any  # (F,) int32
    shape_material: Any  # (S,) int32
    material_kind: Any  # (M,) int64
    material_values: Any  # (M, NUM_VALUES) float64
    material_textures: Any  # (M, NUM_TEXTURES) int32
    texels: Any  # (N,) float32
    texture_info: Any  # (T, 4) int64
    spheres: Any  # (n, 4) float64: centre and radius of glowing spheres


class LightArrays(NamedTuple):
    """Lights; the panorama is empty (0 rows) where there is no environment.

    `emitters` are lamps with an extent, spheres first, and `emitter_cdf` their power, cumulative, over `emitter_total`.
    """

    suns: Any  # (n, 8) float64
    points: Any  # (n, 6) float64
    panorama: Any  # (H, W, 3) float32
    row_cdf: Any  # (H + 1,) float64
    col_cdf: Any  # (H, W + 1) float64
    emitters: Any  # (n, NUM_EMITTER_VALUES) float64
    emitter_cdf: Any  # (n + 1,) float64
    emitter_total: float
    texels: Any  # as of the world
    texture_info: Any


class CameraArrays(NamedTuple):
    """A pinhole or orthographic camera: rays as affine functions of the pixel position."""

    width: int
    height: int
    orthographic: bool
    origin: Any  # (3,) float64
    corner: Any  # (3,) float64: direction (or origin) of pixel position (0, 0)
    step_x: Any  # (3,) float64: its change per pixel
    step_y: Any  # (3,) float64
    forward: Any  # (3,) float64
