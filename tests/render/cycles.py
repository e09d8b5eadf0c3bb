# blender -b --factory-startup --python cycles.py -- SCENE.json
# Renders a mesh in Blender's Cycles on the processor: a series of pictures of growing sample counts, each with the processor time that it
# took.  The scene is told by bench_cycles.c; binary arrays lie beside it (little-endian float and uint32).
import json
import os
import sys
import time

import bpy
import numpy
from mathutils import Matrix, Vector

path = sys.argv[sys.argv.index("--") + 1]
folder = os.path.dirname(os.path.abspath(path))
with open(path) as file:
    told = json.load(file)


def array(name, kind):
    return numpy.fromfile(os.path.join(folder, name), dtype=kind)


def add_mesh():
    position, triangle = array("position.f32", "<f4"), array("triangle.u32", "<u4").astype(numpy.int32)
    mesh = bpy.data.meshes.new("cloth")
    mesh.vertices.add(len(position) // 3)
    mesh.vertices.foreach_set("co", position)
    faces = len(triangle) // 3
    mesh.loops.add(len(triangle))
    mesh.loops.foreach_set("vertex_index", triangle)
    mesh.polygons.add(faces)
    mesh.polygons.foreach_set("loop_start", numpy.arange(0, 3 * faces, 3, dtype=numpy.int32))
    mesh.polygons.foreach_set("loop_total", numpy.full(faces, 3, dtype=numpy.int32))
    mesh.polygons.foreach_set("use_smooth", numpy.ones(faces, dtype=bool))
    weft = mesh.attributes.new("weft", "FLOAT_VECTOR", "POINT")
    weft.data.foreach_set("vector", array("weft.f32", "<f4"))
    mesh.update()
    mesh.materials.append(add_material())
    bpy.context.collection.objects.link(bpy.data.objects.new("cloth", mesh))


def add_material():
    material = bpy.data.materials.new("satin")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    surface = nodes.new("ShaderNodeBsdfAnisotropic")
    surface.distribution = "GGX"
    surface.inputs["Color"].default_value = (*told["color"], 1.0)
    surface.inputs["Roughness"].default_value = told["roughness"]
    surface.inputs["Anisotropy"].default_value = told["anisotropy"]
    weft = nodes.new("ShaderNodeAttribute")
    weft.attribute_name = "weft"
    links.new(weft.outputs["Vector"], surface.inputs["Tangent"])
    dye = nodes.new("ShaderNodeBsdfDiffuse")
    dye.inputs["Color"].default_value = (*told["dye"], 1.0)
    both = nodes.new("ShaderNodeAddShader")
    out = nodes.new("ShaderNodeOutputMaterial")
    links.new(surface.outputs[0], both.inputs[0])
    links.new(dye.outputs[0], both.inputs[1])
    links.new(both.outputs[0], out.inputs["Surface"])
    return material


def add_lamp():
    lamp = bpy.data.lights.new("lamp", "AREA")
    lamp.shape = "DISK"
    lamp.size = told["lamp_diameter"]
    # of a disk, too, Cycles takes the power for that of the square around it (measured: pi / 4 of the radiance otherwise)
    lamp.energy = told["lamp_radiance"] * lamp.size ** 2 * numpy.pi
    thing = bpy.data.objects.new("lamp", lamp)
    thing.location = told["lamp_position"]
    thing.rotation_euler = Vector(told["lamp_direction"]).to_track_quat("-Z", "Y").to_euler()
    bpy.context.collection.objects.link(thing)


def add_camera(scene):
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit = "HORIZONTAL"
    camera.sensor_width = 36.0
    camera.lens = 36.0 * told["focal_px"] / told["width"]
    thing = bpy.data.objects.new("camera", camera)
    rows = [told["world_from_camera"][4 * k:4 * k + 4] for k in range(3)]  # x right, y down, z ahead
    thing.matrix_world = Matrix([[r[0], -r[1], -r[2], r[3]] for r in rows] + [[0, 0, 0, 1]])
    bpy.context.collection.objects.link(thing)
    scene.camera = thing


def set_up(scene):
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = told["width"], told["height"], 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.threads_mode = "FIXED"
    scene.render.threads = told["threads"]
    scene.render.use_persistent_data = True  # the tree is built for the first picture alone
    scene.render.use_compositing = scene.render.use_sequencer = False
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.pixel_filter_type = "BOX"
    cycles.filter_width = 1.0
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = told["bounces"] - 1  # Cycles counts after the first
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.blur_glossy = 0.0
    cycles.light_sampling_threshold = 0.0
    scene.world = bpy.data.worlds.new("night")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0, 0, 0, 1)


def main():
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    scene = bpy.context.scene
    set_up(scene)
    add_mesh()
    add_lamp()
    add_camera(scene)
    results = []
    for number, samples in enumerate(told["samples"]):
        scene.cycles.samples = samples
        scene.cycles.seed = number
        scene.render.filepath = os.path.join(folder, "cycles_%d.exr" % number)
        before, clock = os.times(), time.perf_counter()
        bpy.ops.render.render(write_still=True)
        after = os.times()
        results.append({"samples": samples, "processor_s": after.user + after.system - before.user - before.system,
                        "seconds": time.perf_counter() - clock})
    with open(os.path.join(folder, "cycles.json"), "w") as out:
        json.dump({"version": bpy.app.version_string, "pictures": results}, out)


try:
    main()
except Exception as failure:  # blender itself would end with 0
    print("cycles.py: %s" % failure)
    sys.exit(1)
