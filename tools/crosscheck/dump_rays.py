"""Writes a scene's triangles and a set of shadow rays for embree_rays: pairs of surface points, chosen by area.
python dump_rays.py SCENE.glb TRIANGLES.bin RAYS.bin [--count N] [--seed N] [--largest EXTENT] [--sorted]"""
import argparse

import numpy as np

from gltf import Glb


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene")
    parser.add_argument("triangles")
    parser.add_argument("rays")
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--largest", type=float, default=np.inf, help="no ray ends on triangles longer than this")
    parser.add_argument("--sorted", action="store_true", help="neighbouring rays start at neighbouring points")
    args = parser.parse_args()
    corner = np.concatenate([p["position"] for p in Glb(args.scene).triangles()]).astype("<f4")
    corner.tofile(args.triangles)
    edge_u, edge_v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    normal = np.cross(edge_u, edge_v).astype(np.float64)
    area = np.linalg.norm(normal, axis=1)
    normal /= area[:, None]
    area[np.ptp(corner, axis=1).max(1) > args.largest] = 0
    random = np.random.default_rng(args.seed)

    def points():
        pick = random.choice(len(corner), args.count, p=area / area.sum())
        u, v = random.random((2, args.count))
        u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
        return corner[pick, 0] + u[:, None] * edge_u[pick] + v[:, None] * edge_v[pick], normal[pick]

    (a, na), (b, _) = points(), points()
    if args.sorted:
        order = np.lexsort(np.floor(a / (np.ptp(a, axis=0).max() / 64)).T)
        a, na = a[order], na[order]
    side = np.sign(((b - a) * na).sum(1, keepdims=True))
    a = a + side * na * 1e-4
    rays = np.empty((args.count, 8), "<f4")
    # Not normalised: t runs from 0 to 1 between the two points.
    rays[:, :3], rays[:, 3], rays[:, 4:7], rays[:, 7] = a, 1e-4, b - a, 1 - 1e-3
    rays.tofile(args.rays)
    print(f"{len(corner)} triangles, {args.count} rays")


if __name__ == "__main__":
    main()
