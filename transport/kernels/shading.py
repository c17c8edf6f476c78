"""From a hit to a scattering event: the point, its frames, and the parameters of the surface there."""

import math
from typing import NamedTuple

from materials.kernels.frames import basis, dot, normalize
from materials.kernels.kinds import (
    COATED,
    DIELECTRIC,
    EMISSION,
    GGX,
    PLAIN,
    ROUGH_DIELECTRIC,
    TABLE,
    TABULATED,
    Surface,
)
from materials.kernels.lean import lean

from .arrays import (
    ALBEDO,
    ALBEDO_TEXTURE,
    ALPHA_TEXTURE,
    ALPHA_U,
    ALPHA_V,
    BUMP_SCALE,
    BUMP_TEXTURE,
    COVERAGE_TEXTURE,
    ETA,
    FILM_ALPHA,
    FILM_COVERAGE,
    FILM_ETA,
    FILM_LEVEL,
    FILM_SIGMA_A,
    FILM_THICKNESS,
    MORE,
    NORMAL_TEXTURE,
    OPACITY_TEXTURE,
    SPECULAR_SCALE,
    TANGENT_COS,
    TANGENT_SIN,
    THICKNESS_TEXTURE,
    TINT_TEXTURE,
)
from .textures import lookup


class Hit(NamedTuple):
    """A point on a surface; vectors are 3-tuples in the world."""

    face: int
    material: int
    u: float
    v: float
    p: tuple
    ng: tuple
    ns: tuple


@lean()
def _corner(array, i):
    return (float(array[i, 0]), float(array[i, 1]), float(array[i, 2]))


@lean()
def _mix(a, b, c, wa, wb, wc):
    return (a[0] * wa + b[0] * wb + c[0] * wc, a[1] * wa + b[1] * wb + c[1] * wc, a[2] * wa + b[2] * wb + c[2] * wc)


@lean()
def texture_coordinates(world, face, b1, b2):
    """Return (u, v) at barycentric coordinates of a face."""
    i, j, k = world.faces[face, 0], world.faces[face, 1], world.faces[face, 2]
    b0 = 1.0 - b1 - b2
    u = world.uv[i, 0] * b0 + world.uv[j, 0] * b1 + world.uv[k, 0] * b2
    v = world.uv[i, 1] * b0 + world.uv[j, 1] * b1 + world.uv[k, 1] * b2
    return u, v


@lean()
def is_cut_out(world, face, b1, b2):
    """Return whether the opacity texture makes a hole here."""
    texture = world.material_textures[world.shape_material[world.face_shape[face]], OPACITY_TEXTURE]
    if texture < 0:
        return False
    u, v = texture_coordinates(world, face, b1, b2)
    return lookup(world.texels, world.texture_info, texture, u, v, 0) < 0.5


@lean()
def face_normal(world, face):
    """Return the geometric normal of a face."""
    a = _corner(world.vertices, world.faces[face, 0])
    b = _corner(world.vertices, world.faces[face, 1])
    c = _corner(world.vertices, world.faces[face, 2])
    return normalize(cross((b[0] - a[0], b[1] - a[1], b[2] - a[2]), (c[0] - a[0], c[1] - a[1], c[2] - a[2])))


@lean()
def shading_normal(world, face, b1, b2):
    """Return the interpolated normal of a face."""
    i, j, k = world.faces[face, 0], world.faces[face, 1], world.faces[face, 2]
    n = _mix(_corner(world.normals, i), _corner(world.normals, j), _corner(world.normals, k), 1.0 - b1 - b2, b1, b2)
    return normalize(n)


@lean()
def point_at(world, face, b1, b2):
    """Return the point on a face at barycentric coordinates, and the face's normal."""
    i, j, k = world.faces[face, 0], world.faces[face, 1], world.faces[face, 2]
    p = _mix(_corner(world.vertices, i), _corner(world.vertices, j), _corner(world.vertices, k), 1.0 - b1 - b2, b1, b2)
    return p, face_normal(world, face)


@lean()
def hit_at(world, face, b1, b2):
    """Return the hit on a face at barycentric coordinates; `ns` lies on the side of `ng`."""
    i, j, k = world.faces[face, 0], world.faces[face, 1], world.faces[face, 2]
    a, b, c = _corner(world.vertices, i), _corner(world.vertices, j), _corner(world.vertices, k)
    p = _mix(a, b, c, 1.0 - b1 - b2, b1, b2)
    e1 = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    e2 = (c[0] - a[0], c[1] - a[1], c[2] - a[2])
    ng = normalize(cross(e1, e2))
    ns = shading_normal(world, face, b1, b2)
    if dot(ns, ng) < 0.0:
        ns = (-ns[0], -ns[1], -ns[2])
    u, v = texture_coordinates(world, face, b1, b2)
    material = world.shape_material[world.face_shape[face]]
    texture = world.material_textures[material, NORMAL_TEXTURE]
    if texture >= 0:
        ns = _mapped_normal(world, texture, i, j, k, u, v, e1, e2, ns)
    texture = world.material_textures[material, BUMP_TEXTURE]
    if texture >= 0:
        ns = _bumped_normal(world, texture, material, i, j, k, u, v, e1, e2, ns)
    return Hit(face, material, u, v, p, ng, ns)


@lean(error_model="numpy")
def tangent(world, i, j, k, e1, e2, n):
    """Return dp/du of a face made perpendicular to n, at unit length; any tangent where the uv are degenerate."""
    du1, dv1 = world.uv[j, 0] - world.uv[i, 0], world.uv[j, 1] - world.uv[i, 1]
    du2, dv2 = world.uv[k, 0] - world.uv[i, 0], world.uv[k, 1] - world.uv[i, 1]
    d = du1 * dv2 - du2 * dv1
    if abs(d) < 1e-20:
        return basis(n)[0]
    t = ((dv2 * e1[0] - dv1 * e2[0]) / d, (dv2 * e1[1] - dv1 * e2[1]) / d, (dv2 * e1[2] - dv1 * e2[2]) / d)
    s = dot(t, n)
    t = (t[0] - s * n[0], t[1] - s * n[1], t[2] - s * n[2])
    if dot(t, t) < 1e-20:
        return basis(n)[0]
    return normalize(t)


@lean()
def cross(a, b):
    """Return the vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@lean()
def _mapped_normal(world, texture, i, j, k, u, v, e1, e2, n):
    """Return the shading normal of a tangent-space normal map: x along dp/du, y along n x dp/du, z along n, as 2 c - 1."""
    t = tangent(world, i, j, k, e1, e2, n)
    b = cross(n, t)
    x = 2.0 * lookup(world.texels, world.texture_info, texture, u, v, 0) - 1.0
    y = 2.0 * lookup(world.texels, world.texture_info, texture, u, v, 1) - 1.0
    z = 2.0 * lookup(world.texels, world.texture_info, texture, u, v, 2) - 1.0
    return normalize((x * t[0] + y * b[0] + z * n[0], x * t[1] + y * b[1] + z * n[1], x * t[2] + y * b[2] + z * n[2]))


@lean(error_model="numpy")
def _bumped_normal(world, texture, material, i, j, k, u, v, e1, e2, n):
    """Return the normal of a surface raised by a height map: n minus the height's gradient along the surface.

    M. Mikkelsen, "Bump Mapping Unparametrized Surfaces on the GPU", 2010, eq. 4, from dp/du and dp/dv of the triangle.
    """
    du1, dv1 = world.uv[j, 0] - world.uv[i, 0], world.uv[j, 1] - world.uv[i, 1]
    du2, dv2 = world.uv[k, 0] - world.uv[i, 0], world.uv[k, 1] - world.uv[i, 1]
    d = du1 * dv2 - du2 * dv1
    if abs(d) < 1e-20:
        return n
    pu = ((dv2 * e1[0] - dv1 * e2[0]) / d, (dv2 * e1[1] - dv1 * e2[1]) / d, (dv2 * e1[2] - dv1 * e2[2]) / d)
    pv = ((du1 * e2[0] - du2 * e1[0]) / d, (du1 * e2[1] - du2 * e1[1]) / d, (du1 * e2[2] - du2 * e1[2]) / d)
    # Central differences over a texel: the slope of bilinear heights, averaged over the two texels it may jump between.
    hu, hv = 0.5 / world.texture_info[texture, 1], 0.5 / world.texture_info[texture, 2]
    scale = world.material_values[material, BUMP_SCALE]
    east = lookup(world.texels, world.texture_info, texture, u + hu, v, 0)
    west = lookup(world.texels, world.texture_info, texture, u - hu, v, 0)
    south = lookup(world.texels, world.texture_info, texture, u, v + hv, 0)
    north = lookup(world.texels, world.texture_info, texture, u, v - hv, 0)
    slope_u, slope_v = scale * (east - west) / (2.0 * hu), scale * (south - north) / (2.0 * hv)
    a, b = cross(pv, n), cross(n, pu)
    area = dot(pu, a)
    if area == 0.0:
        return n
    x = n[0] - (slope_u * a[0] + slope_v * b[0]) / area
    y = n[1] - (slope_u * a[1] + slope_v * b[1]) / area
    z = n[2] - (slope_u * a[2] + slope_v * b[2]) / area
    return normalize((x, y, z))


@lean()
def has_relief(world, material):
    """Return whether a normal or bump map bends the shading normal."""
    textures = world.material_textures
    return textures[material, NORMAL_TEXTURE] >= 0 or textures[material, BUMP_TEXTURE] >= 0


@lean(error_model="numpy")
def valid_normal(n, ng, wo):
    """Return n bent towards ng until wo, mirrored about it, leaves the surface.

    Mirrored light below the geometric surface would be lost: black fringes. A. Keller et al., "The Iray Light Transport
    Simulation and Rendering System", 2017, appendix A.3. Light that comes from below ng is cut off by the tracer, so that
    nothing leaks through the surface either.
    """
    c = 2.0 * dot(n, wo)
    m = (c * n[0] - wo[0], c * n[1] - wo[1], c * n[2] - wo[2])
    below = dot(m, ng)
    if below >= 1e-3:
        return n
    lift = 1e-3 - below
    m = normalize((m[0] + lift * ng[0], m[1] + lift * ng[1], m[2] + lift * ng[2]))
    return normalize((wo[0] + m[0], wo[1] + m[1], wo[2] + m[2]))


@lean()
def hit_tangent(world, hit, n):
    """Return the direction of alpha_u on the surface of a hit: dp/du, turned by the material's tangent angle."""
    i, j, k = world.faces[hit.face, 0], world.faces[hit.face, 1], world.faces[hit.face, 2]
    a, b, c = _corner(world.vertices, i), _corner(world.vertices, j), _corner(world.vertices, k)
    e1 = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    e2 = (c[0] - a[0], c[1] - a[1], c[2] - a[2])
    t = tangent(world, i, j, k, e1, e2, n)
    c, s = world.material_values[hit.material, TANGENT_COS], world.material_values[hit.material, TANGENT_SIN]
    b = cross(n, t)
    return (c * t[0] + s * b[0], c * t[1] + s * b[1], c * t[2] + s * b[2])


@lean()
def _value(world, material, column, slot, u, v):
    """Return a scalar parameter: its value, times its texture where it has one."""
    value = world.material_values[material, column]
    texture = world.material_textures[material, slot]
    if texture >= 0:
        value *= lookup(world.texels, world.texture_info, texture, u, v, 0)
    return value


@lean()
def film_coverage(world, hit):
    """Return the share of the area below water at a hit."""
    if world.material_values[hit.material, FILM_COVERAGE] <= 0.0:
        return 0.0
    return _value(world, hit.material, FILM_COVERAGE, COVERAGE_TEXTURE, hit.u, hit.v)


@lean()
def surface_at(world, hit, below_film):
    """Return the parameters of the surface at a hit, seen through the water film or bare."""
    m = hit.material
    row = world.material_values[m]
    r, g, b = row[ALBEDO], row[ALBEDO + 1], row[ALBEDO + 2]
    texture = world.material_textures[m, ALBEDO_TEXTURE]
    if texture >= 0:
        r *= lookup(world.texels, world.texture_info, texture, hit.u, hit.v, 0)
        g *= lookup(world.texels, world.texture_info, texture, hit.u, hit.v, 1)
        b *= lookup(world.texels, world.texture_info, texture, hit.u, hit.v, 2)
    texture = world.material_textures[m, ALPHA_TEXTURE]
    alpha_u, alpha_v = row[ALPHA_U], row[ALPHA_V]
    if texture >= 0:
        alpha_u *= lookup(world.texels, world.texture_info, texture, hit.u, hit.v, 0)
        alpha_v *= lookup(world.texels, world.texture_info, texture, hit.u, hit.v, 1)
    kind = world.material_kind[m]
    if below_film:
        d = _value(world, m, FILM_THICKNESS, THICKNESS_TEXTURE, hit.u, hit.v)
        tau_r, tau_g, tau_b = row[FILM_SIGMA_A] * d, row[FILM_SIGMA_A + 1] * d, row[FILM_SIGMA_A + 2] * d
        specular = row[SPECULAR_SCALE] if kind == GGX else 0.0
        eta = row[ETA]
        return Surface(COATED, r, g, b, specular, eta, alpha_u, alpha_v, row[FILM_ETA], row[FILM_ALPHA], tau_r, tau_g, tau_b, PLAIN)
    if kind == COATED:
        # A coat is a film without thickness whose index and roughness are the material's own.
        return Surface(COATED, r, g, b, 0.0, row[ETA], alpha_u, alpha_v, row[ETA], alpha_u, 0.0, 0.0, 0.0, PLAIN)
    q = row[MORE:]
    if kind == TABULATED:
        more = (q[TABLE], hit.u, hit.v, q[3], q[4], q[5], q[6], q[7], q[8], q[9])
        return Surface(kind, r, g, b, row[SPECULAR_SCALE], row[ETA], alpha_u, alpha_v, 1.33, 0.0, 0.0, 0.0, 0.0, more)
    tint_r, tint_g, tint_b = q[0], q[1], q[2]
    texture = world.material_textures[m, TINT_TEXTURE]
    if texture >= 0:
        tint_r *= lookup(world.texels, world.texture_info, texture, hit.u, hit.v, 0)
        tint_g *= lookup(world.texels, world.texture_info, texture, hit.u, hit.v, 1)
        tint_b *= lookup(world.texels, world.texture_info, texture, hit.u, hit.v, 2)
    more = (tint_r, tint_g, tint_b, q[3], q[4], q[5], q[6], q[7], q[8], q[9])
    return Surface(kind, r, g, b, row[SPECULAR_SCALE], row[ETA], alpha_u, alpha_v, 1.33, 0.0, 0.0, 0.0, 0.0, more)


@lean()
def is_two_faced(kind):
    """Return whether the two sides of a surface differ (glass has an inside)."""
    return kind in (DIELECTRIC, ROUGH_DIELECTRIC)


@lean()
def emits(kind):
    """Return whether a material emits."""
    return kind == EMISSION


@lean()
def film_normal(world, hit):
    """Return the normal of the water's surface: upright for a puddle, the shading normal for a thin film."""
    if world.material_values[hit.material, FILM_LEVEL] > 0.5:
        return (0.0, 0.0, 1.0)
    return hit.ns


@lean()
def leave(p, ng, w):
    """Return the start of a ray that leaves a surface along w, moved off it to its side of w.

    Embree's hits are as exact as float32 vertices let them be: some units in the last place of the largest
    coordinate. The step of 2^-17 of it is about 60 of them; the fixed part serves near the origin.
    """
    step = 2e-5 + 7.6e-6 * max(abs(p[0]), max(abs(p[1]), abs(p[2])))
    if dot(ng, w) < 0.0:
        step = -step
    return (p[0] + ng[0] * step, p[1] + ng[1] * step, p[2] + ng[2] * step)


@lean(error_model="numpy")
def power_heuristic(pdf, other):
    """Return the weight of a sample of density `pdf` that a second strategy draws with density `other` (Veach 1997)."""
    if math.isinf(pdf):
        return 1.0
    a, b = pdf * pdf, other * other
    return a / (a + b) if a + b > 0.0 else 0.0
