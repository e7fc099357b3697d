"""Times any-hit queries through embreex: python embree_rays.py TRIANGLES.bin RAYS.bin [--repeats N]
embreex takes no tmin and traces on one thread, one ray at a time, from Python arrays; embree_rays.c is the fair number."""
import argparse
import time

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("triangles")
    parser.add_argument("rays")
    parser.add_argument("--repeats", type=int, default=3)
    args = parser.parse_args()
    triangles = np.fromfile(args.triangles, "<f4").reshape(-1, 3, 3)
    rays = np.fromfile(args.rays, "<f4").reshape(-1, 8)
    # tmin: moved into the origin.
    origin = np.ascontiguousarray(rays[:, :3] + rays[:, 3:4] * rays[:, 4:7])
    direction, reach = np.ascontiguousarray(rays[:, 4:7]), np.ascontiguousarray(rays[:, 7] - rays[:, 3])
    scene = EmbreeScene()
    TriangleMesh(scene, triangles)
    scene.run(origin[:1], direction[:1], dists=reach[:1], query="OCCLUDED")  # builds
    best = np.inf
    for _ in range(args.repeats):
        start, cpu = time.perf_counter(), time.process_time()
        # 0: occluded; -1: free.
        result = scene.run(origin, direction, dists=reach, query="OCCLUDED")
        seconds = time.perf_counter() - start
        best, cores = min(best, seconds), (time.process_time() - cpu) / seconds
    occluded = int((result == 0).sum())
    print(f"{len(triangles)} triangles, {len(rays)} rays, embreex: {len(rays) / best * 1e-6:.3f} Mrays/s on {cores:.2f} cores, "
          f"{occluded} occluded ({occluded / len(rays):.4f})")


if __name__ == "__main__":
    main()
