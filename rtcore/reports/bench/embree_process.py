"""`python -m rtcore.reports.bench.embree_process FILE.npz`: Embree, one ray at a time on one thread, in a process of its own.

The file holds the triangles and sets of rays, NAME_origins and NAME_directions, float32. Each line of input names a set; the answer is the
seconds of one distance query, and the distances lie in NAME.npy beside the file, 1e37 where nothing is hit.
"""
import sys
import time
from pathlib import Path

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene


def main(path: str) -> None:
    """Answer until the input ends."""
    with np.load(path) as data:
        arrays = dict(data)
    scene = EmbreeScene()
    mesh = TriangleMesh(scene, arrays["triangles"])     # held: Embree reads its arrays in place
    for line in sys.stdin:
        name = line.strip()
        start = time.perf_counter()
        t = scene.run(arrays[f"{name}_origins"], arrays[f"{name}_directions"], query="DISTANCE")
        seconds = time.perf_counter() - start
        np.save(Path(path).with_name(f"{name}.npy"), t)
        print(seconds, flush=True)
    del mesh


if __name__ == "__main__":
    main(sys.argv[1])
