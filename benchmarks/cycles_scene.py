"""Render an exported wet frame with Blender Cycles. Runs in Blender's own Python, as a process of its own.

`python cycles_scene.py FRAME.npz` builds the scene and then obeys lines on stdin: `SAMPLES SEED FILE.exr` renders and
answers `{"seconds": ...}` on stdout; the end of stdin ends it. Nothing of this project is imported: that environment lacks it.

The scene is that of `benchmarks/cycles_export.py`: the ground's glossy layer alone is seen by the camera (Principled with a
black base is one GGX lobe under the dielectric Fresnel of its half vector); all other rays meet the picture as emission.
"""

import json
import os
import resource
import sys
import time

import bpy  # pyright: ignore[reportMissingImports]
import numpy as np


def _image(name, values):
    """Return a float image as given: rows from the top, three channels or one, no colour management."""
    height, width = values.shape[:2]
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = values if values.ndim == 3 else values[..., None]
    image = bpy.data.images.new(name, width, height, alpha=False, float_buffer=True, is_data=True)
    image.colorspace_settings.name = "Non-Color"
    image.alpha_mode = "NONE"
    image.pixels.foreach_set(pixels[::-1].ravel())
    image.pack()
    return image


def _mesh(name, vertices, faces, colours=None):
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    mesh.loops.add(3 * len(faces))
    mesh.loops.foreach_set("vertex_index", faces.astype(np.int32).ravel())
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * len(faces), 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    if colours is not None:
        mesh.attributes.new("fill", "FLOAT_COLOR", "POINT").data.foreach_set("color", colours.astype(np.float32).ravel())
        mesh.shade_smooth()
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(thing)
    return thing


class _Nodes:
    """A node tree with short words for what is needed here."""

    def __init__(self, owner):
        owner.use_nodes = True
        self.tree = owner.node_tree
        self.tree.nodes.clear()

    def add(self, kind, inputs=None, **settings):
        node = self.tree.nodes.new(kind)
        for key, value in settings.items():
            setattr(node, key, value)
        for key, value in (inputs or {}).items():
            if hasattr(value, "is_output"):
                self.tree.links.new(value, node.inputs[key])
            else:
                node.inputs[key].default_value = value
        return node

    def math(self, operation, a, b, c=None):
        inputs = {0: a, 1: b} if c is None else {0: a, 1: b, 2: c}
        return self.add("ShaderNodeMath", inputs, operation=operation).outputs[0]

    def picture_position(self, camera):
        """Return where a point falls in the picture; Cycles hands out coordinates of the camera, y up and z forward."""
        xyz = self.add("ShaderNodeSeparateXYZ", {0: self.add("ShaderNodeTexCoord").outputs["Camera"]}).outputs
        width, height = camera["width"], camera["height"]
        u = self.math("MULTIPLY_ADD", self.math("DIVIDE", xyz[0], xyz[2]), camera["fx"] / width, camera["cx"] / width)
        v = self.math("MULTIPLY_ADD", self.math("DIVIDE", xyz[1], xyz[2]), camera["fy"] / height, 1 - camera["cy"] / height)
        return self.add("ShaderNodeCombineXYZ", {0: u, 1: v}).outputs[0]

    def texture(self, image, position, interpolation="Linear"):
        node = self.add("ShaderNodeTexImage", {0: position}, interpolation=interpolation, extension="EXTEND")
        node.image = image
        return node.outputs[0]

    def emission(self, colour):
        return self.add("ShaderNodeEmission", {"Color": colour}).outputs[0]

    def mix(self, factor, first, second):
        return self.add("ShaderNodeMixShader", {0: factor, 1: first, 2: second}).outputs[0]

    def gloss(self, roughness, eta, normal=None):
        inputs = {"Base Color": (0, 0, 0, 1), "Roughness": roughness, "IOR": eta}
        if normal is not None:
            inputs["Normal"] = normal
        return self.add("ShaderNodeBsdfPrincipled", inputs, distribution="GGX").outputs[0]

    def finish(self, shader):
        self.add("ShaderNodeOutputMaterial", {0: shader})


def _material(name):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    # A million glowing triangles are no lamps to pick from: paths that meet them are the better sampler here.
    material.cycles.emission_sampling = "NONE"
    return material


def _seen_or_filled(nodes, picture, camera):
    """Return the emission of a static surface: the picture where it shows the point, else the vertices' colour."""
    fill = nodes.add("ShaderNodeAttribute", attribute_name="fill")
    seen = nodes.texture(picture, nodes.picture_position(camera))
    return nodes.mix(fill.outputs["Alpha"], nodes.emission(fill.outputs["Color"]), nodes.emission(seen))


def _ground(data, camera, picture):
    material = _material("ground")
    nodes = _Nodes(material)
    path = nodes.add("ShaderNodeLightPath").outputs
    window = nodes.add("ShaderNodeTexCoord").outputs["Window"]
    # One texture of three values costs one look-up.
    lobe = nodes.add("ShaderNodeSeparateXYZ", {0: nodes.texture(_image("lobe", data["lobe"]), window, "Closest")}).outputs
    normal = nodes.texture(_image("normal", data["normal"]), window, "Closest")
    first = nodes.gloss(lobe[0], lobe[1], normal)
    xyz = nodes.add("ShaderNodeSeparateXYZ", {0: nodes.add("ShaderNodeNewGeometry").outputs["Position"]}).outputs
    x_min, y_min, x_size, y_size = (float(v) for v in data["grid"])
    u = nodes.math("MULTIPLY_ADD", xyz[0], 1 / x_size, -x_min / x_size)
    v = nodes.math("MULTIPLY_ADD", xyz[1], 1 / y_size, -y_min / y_size)
    place = nodes.add("ShaderNodeCombineXYZ", {0: u, 1: v}).outputs[0]
    # World y grows with the row, texture v from the bottom: rows are handed over upside down.
    wet = nodes.texture(_image("wet", data["grid_lobe"][::-1]), place)
    wet = nodes.add("ShaderNodeSeparateXYZ", {0: wet}).outputs
    glow = _seen_or_filled(nodes, picture, camera)
    again = nodes.mix(wet[2], nodes.add("ShaderNodeBsdfTransparent", {0: (0, 0, 0, 1)}).outputs[0], nodes.gloss(wet[0], wet[1]))
    later = nodes.add("ShaderNodeAddShader", {0: glow, 1: again}).outputs[0]
    nodes.finish(nodes.mix(path["Is Camera Ray"], later, first))
    return material


def _environment(camera, picture):
    material = _material("environment")
    nodes = _Nodes(material)
    path = nodes.add("ShaderNodeLightPath").outputs
    nodes.finish(nodes.mix(path["Is Camera Ray"], _seen_or_filled(nodes, picture, camera), nodes.emission((0, 0, 0, 1))))
    return material


def _body(name, camera, instance, instances, colour):
    """Return the material of a moving object: what its mask shows; `colour` is the picture or a mean."""
    material = _material(name)
    nodes = _Nodes(material)
    path = nodes.add("ShaderNodeLightPath").outputs
    position = nodes.picture_position(camera)
    shown = nodes.emission(nodes.texture(colour, position) if isinstance(colour, bpy.types.Image) else colour)
    shown = nodes.mix(path["Is Camera Ray"], shown, nodes.emission((0, 0, 0, 1)))
    if instances is None:
        nodes.finish(shown)
        return material
    inside = nodes.math("COMPARE", nodes.texture(instances, position, "Closest"), float(instance), 0.5)
    nodes.finish(nodes.mix(inside, nodes.add("ShaderNodeBsdfTransparent").outputs[0], shown))
    return material


def _sky(panorama):
    world = bpy.data.worlds.new("sky")
    bpy.context.scene.world = world
    nodes = _Nodes(world)
    texture = nodes.add("ShaderNodeTexEnvironment", interpolation="Linear")
    texture.image = _image("sky", panorama)
    background = nodes.add("ShaderNodeBackground", {"Color": texture.outputs[0]}).outputs[0]
    nodes.add("ShaderNodeOutputWorld", {0: background})
    world.cycles_visibility.camera = False
    world.cycles.sampling_method = os.environ.get("CYCLES_SKY_SAMPLING", "AUTOMATIC")


def _camera(camera, T_world_camera):
    data = bpy.data.cameras.new("camera")
    width, height = camera["width"], camera["height"]
    data.sensor_fit = "HORIZONTAL"
    data.lens = camera["fx"] * data.sensor_width / width
    data.shift_x = (width / 2 - camera["cx"]) / width
    data.shift_y = (camera["cy"] - height / 2) / width
    data.clip_start, data.clip_end = 0.01, 1e4
    thing = bpy.data.objects.new("camera", data)
    from mathutils import Matrix  # pyright: ignore[reportMissingImports]

    thing.matrix_world = Matrix((T_world_camera @ np.diag([1.0, -1.0, -1.0, 1.0])).tolist())
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.scene.camera = thing


def build(file):
    """Build the exported frame."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    data = np.load(file)
    camera = json.loads(str(data["camera"]))
    picture = _image("picture", data["picture"])
    ground_picture = _image("ground picture", data["ground_picture"])
    instances = _image("instances", data["instances"].astype(np.float32))
    for name, material in (("ground", _ground(data, camera, ground_picture)), ("environment", _environment(camera, picture))):
        thing = _mesh(name, data[f"{name}_vertices"], data[f"{name}_faces"], data[f"{name}_fill"])
        thing.data.materials.append(material)
    for i, (role, instance) in enumerate(data["bodies"]):
        thing = _mesh(f"body {i}", data[f"body{i}_vertices"], data[f"body{i}_faces"])
        colour = picture if role == 2 else (*(float(c) for c in data["body_means"][i]), 1.0)
        # 2 is the cardboard, 3 the hull behind it, 4 the underside, which the camera looks past.
        thing.data.materials.append(_body(f"body {i}", camera, instance, None if role == 4 else instances, colour))
        thing.visible_camera = role != 4
    _sky(data["sky"])
    _camera(camera, data["T_world_camera"])
    _settings(camera, [int(v) for v in data["rows"]], int(data["bounces"]))


def _settings(camera, rows, bounces):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = (
        camera["width"],
        camera["height"],
        100,
    )
    # Only the rows that show ground are rendered.
    scene.render.use_border, scene.render.use_crop_to_border = True, False
    scene.render.border_min_x, scene.render.border_max_x = 0.0, 1.0
    scene.render.border_min_y = 1 - rows[1] / camera["height"]
    scene.render.border_max_y = 1 - rows[0] / camera["height"]
    scene.render.threads_mode, scene.render.threads = "FIXED", 2
    scene.render.use_persistent_data = True
    scene.render.film_transparent = False
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth, scene.render.image_settings.color_mode = "32", "RGB"
    scene.render.image_settings.exr_codec = "NONE"
    scene.render.use_compositing = scene.render.use_sequencer = False
    c = scene.cycles
    c.device = "CPU"
    c.use_adaptive_sampling = c.use_denoising = c.use_fast_gi = False
    c.pixel_filter_type = "BOX"
    c.max_bounces = c.glossy_bounces = bounces
    c.diffuse_bounces = c.transmission_bounces = c.volume_bounces = 0
    c.transparent_max_bounces = 16
    c.sample_clamp_direct = c.sample_clamp_indirect = c.blur_glossy = 0.0
    c.caustics_reflective = True
    c.use_auto_tile = False


def main():
    # Blender writes its own lines to stdout; the answers go to a copy of it, the rest to stderr.
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    start = time.perf_counter()
    build(sys.argv[1])
    answers.write(json.dumps({"seconds": time.perf_counter() - start}) + "\n")
    scene = bpy.context.scene
    for line in sys.stdin:
        samples, seed, file = line.split(maxsplit=2)
        scene.cycles.samples, scene.cycles.seed = int(samples), int(seed)
        scene.render.filepath = file.strip()
        before, start = time.process_time(), time.perf_counter()
        bpy.ops.render.render(write_still=True)
        seconds, busy = time.perf_counter() - start, time.process_time() - before
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        answers.write(json.dumps({"seconds": seconds, "cpu_seconds": busy, "peak_mib": peak}) + "\n")


main()
