"""What a ray meets first, and whether a light is seen, past the holes of cut-outs and the glowing spheres."""

from materials.kernels.lean import lean

from .emitters import FAR, nearest_sphere, spheres_block
from .rays import intersect, occluded
from .shading import is_cut_out, leave, point_at


@lean()
def first_hit(world, buffer, s, o, d):
    """Return (face, b1, b2, distance) of the nearest surface, passing through cut-outs; face -1 is none, or a glowing sphere."""
    _, sphere = nearest_sphere(world.spheres, o, d)
    travelled = 0.0
    for _ in range(256):
        far = sphere - travelled
        if far <= 0.0:
            break
        face, t, b1, b2 = intersect(
            world.static_scene, world.dynamic_scene, world.num_static_faces, buffer, s, o[0], o[1], o[2], d[0], d[1], d[2], far
        )
        if face < 0:
            break
        travelled += t
        if not (world.has_cutouts and is_cut_out(world, face, b1, b2)):
            return face, b1, b2, travelled
        p, ng = point_at(world, face, b1, b2)
        o = leave(p, ng, d)
    return -1, 0.0, 0.0, sphere if sphere < FAR else 0.0


@lean()
def is_visible(world, buffer, s, o, d, far):
    """Return whether nothing opaque lies on a ray before distance `far`."""
    if spheres_block(world.spheres, o, d, far):
        return False
    if not world.has_cutouts:
        return not occluded(world.static_scene, world.dynamic_scene, buffer, s, o[0], o[1], o[2], d[0], d[1], d[2], far)
    face, _, _, t = first_hit(world, buffer, s, o, d)
    return face < 0 or t >= far
