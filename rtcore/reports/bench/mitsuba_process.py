"""`python -m rtcore.reports.bench.mitsuba_process SCENE.json`: Mitsuba's `direct` integrator in a process of its own.

The file says which mesh, camera, light, size and how many threads. Each line of input asks for one render of one sample a pixel; the
answer is its seconds. The last picture's brightness is in SCENE.json.npy.
"""
import json
import sys
import time

import drjit
import mitsuba
import numpy as np


def main(path: str) -> None:
    """Answer until the input ends."""
    mitsuba.set_variant("scalar_rgb")
    with open(path) as file:
        told = json.load(file)
    drjit.set_thread_count(told["threads"])
    width, height = told["size"]
    scene = mitsuba.load_dict({
        "type": "scene",
        # every ray of the other kind would be wasted on a light without extent
        "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
        "sensor": {
            "type": "perspective", "fov": told["fov"], "fov_axis": "y",
            "to_world": mitsuba.ScalarTransform4f().look_at(origin=told["lookfrom"], target=told["lookat"], up=told["up"]),
            "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": 1}},
        "light": {"type": "point", "position": told["light"], "intensity": {"type": "rgb", "value": [told["intensity"]] * 3}},
        "mesh": {"type": "ply", "filename": told["mesh"], "face_normals": True,
                 "bsdf": {"type": "twosided", "bsdf": {"type": "diffuse"}}}})
    for number, _ in enumerate(sys.stdin):
        start = time.perf_counter()
        image = np.array(mitsuba.render(scene, spp=1, seed=number))
        seconds = time.perf_counter() - start
        np.save(f"{path}.npy", image.mean(axis=2))
        print(seconds, flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
