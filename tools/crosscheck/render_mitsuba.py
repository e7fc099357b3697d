"""Renders a shot with Mitsuba 3 as a reference for manylight. See README.md beside this file."""
import argparse
import glob
import json
import os
import pathlib
import sys
import tempfile
import time

import numpy as np

from gltf import Glb

LAYERS = ("emission", "direct", "indirect", "beauty")
WRAP = {10497: "repeat", 33648: "mirror", 33071: "clamp"}


def find_llvm():
    """Debian's LLVM 14 and 15 lack an instruction that Dr.Jit emits: take the newest that is installed."""
    if "DRJIT_LIBLLVM_PATH" in os.environ:
        return True
    for major in range(25, 15, -1):
        for pattern in (f"/usr/lib/*/libLLVM.so.{major}*", f"/usr/lib/*/libLLVM-{major}.so*",
                        f"/usr/lib/llvm-{major}/lib/libLLVM*.so*"):
            for path in sorted(glob.glob(pattern)):
                os.environ["DRJIT_LIBLLVM_PATH"] = path
                return True
    return False


def linear(srgb):
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4).astype(np.float32)


def enlarge(image, wrap, n=4):
    """n times as many texels, read bilinearly, so that a threshold cuts as a bilinear lookup would."""
    for axis in (0, 1):
        size = image.shape[axis]
        at = (np.arange(size * n) + 0.5) / n - 0.5
        low = np.floor(at).astype(int)
        part = (at - low).astype(np.float32)
        part = part[:, None] if axis == 0 else part[None, :]
        pick = lambda i: np.take(image, i % size if wrap == "repeat" else np.clip(i, 0, size - 1), axis)
        image = pick(low) * (1 - part) + pick(low + 1) * part
    return image


class Materials:
    def __init__(self, mi, glb):
        self.mi, self.glb, self.doc = mi, glb, glb.doc

    def bitmap(self, pixels, wrap, filter_type):
        return {"type": "bitmap", "bitmap": self.mi.Bitmap(np.ascontiguousarray(pixels, np.float32)), "raw": True,
                "wrap_mode": wrap, "filter_type": filter_type}

    def bsdf(self, index, colour):
        material = self.doc["materials"][index] if index is not None else {}
        pbr = material.get("pbrMetallicRoughness", {})
        factor = np.array(pbr.get("baseColorFactor", (1, 1, 1, 1)), np.float32)
        mode = material.get("alphaMode", "OPAQUE")
        opacity = factor[3]
        if "baseColorTexture" in pbr:
            info = pbr["baseColorTexture"]
            if info.get("texCoord", 0) or "KHR_texture_transform" in info.get("extensions", {}) or colour:
                sys.exit(f"material {index}: second texture coordinates, texture transforms and vertex colours "
                         "over a texture are not supported here")
            texture = self.doc["textures"][info["index"]]
            sampler = self.doc["samplers"][texture["sampler"]] if "sampler" in texture else {}
            wrap = WRAP[sampler.get("wrapS", 10497)]
            if wrap != WRAP[sampler.get("wrapT", 10497)]:
                sys.exit(f"material {index}: different wrapping in s and t is not supported here")
            filter_type = "nearest" if sampler.get("magFilter") == 9728 else "bilinear"
            pixels = self.glb.image(texture["source"])
            reflectance = self.bitmap(linear(pixels[..., :3]) * factor[:3], wrap, filter_type)
            alpha = pixels[..., 3] * factor[3]
            if mode == "MASK":
                cut = material.get("alphaCutoff", 0.5)
                solid = enlarge(alpha, wrap) if filter_type == "bilinear" else alpha
                opacity = self.bitmap((solid >= cut)[..., None], wrap, "nearest")
            elif mode == "BLEND" and (alpha != alpha.flat[0]).any():
                opacity = self.bitmap(alpha[..., None], wrap, filter_type)
            elif mode == "BLEND":
                opacity = alpha.flat[0]
        else:
            reflectance = ({"type": "mesh_attribute", "name": "vertex_color"} if colour
                           else {"type": "rgb", "value": factor[:3].tolist()})
            if mode == "MASK":
                opacity = float(factor[3] >= material.get("alphaCutoff", 0.5))
        out = {"type": "twosided", "nested": {"type": "diffuse", "reflectance": reflectance}}
        if mode != "OPAQUE" and (isinstance(opacity, dict) or opacity < 1):
            out = {"type": "mask", "nested": out, "opacity": opacity if isinstance(opacity, dict) else float(opacity)}
        return out

    def factor(self, index):
        return self.doc["materials"][index].get("pbrMetallicRoughness", {}).get("baseColorFactor", (1, 1, 1, 1))[:3]

    def radiance(self, index, lights):
        if index is None:
            return None
        material = self.doc["materials"][index]
        for light in lights:
            if light["type"] == "emissive" and light["material"] == material.get("name"):
                return np.array(light["radiance"], float)
        if "emissiveTexture" in material and any(material.get("emissiveFactor", ())):
            sys.exit(f"material {index}: emissive textures are not supported here")
        strength = material.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
        return np.array(material.get("emissiveFactor", (0, 0, 0)), float) * strength


def write_ply(path, position, normal, uv, colour=None):
    names = ["x", "y", "z", "nx", "ny", "nz", "u", "v"] + (["r", "g", "b"] if colour is not None else [])
    columns = [position.reshape(-1, 3), normal.reshape(-1, 3), uv.reshape(-1, 2)]
    columns += [colour.reshape(-1, 3)] if colour is not None else []
    vertices = np.concatenate(columns, 1).astype("<f4")
    faces = np.empty(len(position), np.dtype([("n", "u1"), ("i", "<i4", 3)]))
    faces["n"], faces["i"] = 3, np.arange(len(vertices)).reshape(-1, 3)
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {n}" for n in names]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    with open(path, "wb") as file:
        file.write(("\n".join(header) + "\n").encode())
        file.write(vertices.tobytes())
        file.write(faces.tobytes())


def build(mi, shot_path, size, folder, face_normals):
    shot = json.load(open(shot_path))
    scene_path = shot_path.parent / shot["scene"]
    if "lights" not in shot:
        sys.exit(f"{shot_path}: a shot without a lights list is not supported here")
    lights = shot["lights"]
    glb = Glb(scene_path)
    materials = Materials(mi, glb)
    camera = shot["camera"]
    out = {"type": "scene", "sensor": {
        "type": "perspective", "fov_axis": "y", "fov": camera["vfov_deg"], "near_clip": 1e-3, "far_clip": 1e5,
        "to_world": mi.ScalarTransform4f().look_at(camera["position"], camera["target"], camera["up"]),
        "film": {"type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"},
                 "pixel_format": "rgb", "component_format": "float32"},
        "sampler": {"type": "independent"}}}

    groups, dropped = {}, 0
    for part in glb.triangles():
        dropped += part["dropped"]
        groups.setdefault((part["material"], part["colour"] is not None), []).append(part)
    count = 0
    for (index, colour), parts in groups.items():
        join = lambda key: np.concatenate([p[key] for p in parts])
        radiance = materials.radiance(index, lights)
        shines = radiance is not None and radiance.any()
        name = f"m{index}_{int(colour)}"
        count += len(join("position"))
        # An emitter's front is told by its winding, so emitters are flat-shaded.
        write_ply(f"{folder}/{name}.ply", join("position"), join("flat" if shines or face_normals else "normal"), join("uv"),
                  join("colour") * np.array(materials.factor(index)) if colour else None)
        shape = {"type": "ply", "filename": f"{folder}/{name}.ply", "bsdf": materials.bsdf(index, colour)}
        if shines:
            if glb.doc["materials"][index].get("doubleSided"):
                print(f"material {index}: emission of a double-sided material is taken on the front only", file=sys.stderr)
            shape["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": radiance.tolist()}}
        out[name] = shape
    print(f"{scene_path.name}: {count} triangles, {dropped} degenerate dropped, {len(groups)} meshes", file=sys.stderr)

    for i, light in enumerate(lights):
        rgb = lambda key: {"type": "rgb", "value": light[key]}
        if light["type"] == "sun":
            out[f"light{i}"] = {"type": "directional", "direction": light["direction"], "irradiance": rgb("irradiance")}
        elif light["type"] == "point":
            out[f"light{i}"] = {"type": "point", "position": light["position"], "intensity": rgb("intensity")}
        elif light["type"] == "sky" and "map" not in light:
            out[f"light{i}"] = {"type": "constant", "radiance": rgb("radiance")}
        elif light["type"] == "area":
            c, u, v = (np.array(light[k], float) for k in ("corner", "edge_u", "edge_v"))
            corner = np.array([[c, c + u, c + u + v], [c, c + u + v, c + v]])
            normal = np.broadcast_to(np.cross(u, v) / np.linalg.norm(np.cross(u, v)), corner.shape)
            write_ply(f"{folder}/light{i}.ply", corner, normal, np.zeros((2, 3, 2)))
            out[f"light{i}"] = {"type": "ply", "filename": f"{folder}/light{i}.ply",
                                "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}},
                                "emitter": {"type": "area", "radiance": rgb("radiance")}}
        elif light["type"] != "emissive":
            sys.exit(f"light {i} of type {light['type']} is not supported here")
    return mi.load_dict(out)


def depth_terms(layer, bounces):
    """A layer as a sum of path lengths: (factor, max_depth). Depth counts the edges from the eye, less the first."""
    return {"emission": [(1, 1)], "direct": [(1, 2), (-1, 1)], "indirect": [(1, 1 + bounces), (-1, 2)],
            "beauty": [(1, 1 + bounces)]}[layer]


def save(mi, path, image):
    path = pathlib.Path(path)
    if path.suffix == ".npy":
        np.save(path, image)
    elif path.suffix == ".pfm":
        with open(path, "wb") as file:
            file.write(f"PF\n{image.shape[1]} {image.shape[0]}\n-1.0\n".encode())
            file.write(image[::-1].astype("<f4").tobytes())
    else:
        mi.Bitmap(image).write(str(path))


def main():
    root = pathlib.Path(__file__).resolve().parents[2]
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("shot", help="a shot file, or its name in SCENES/shots")
    parser.add_argument("--scenes", type=pathlib.Path, default=root / "../shared/scenes")
    parser.add_argument("--layer", choices=LAYERS + ("all",), default="all")
    parser.add_argument("--spp", type=int, default=512)
    parser.add_argument("--pass-spp", type=int, default=32, help="samples per independent pass; the passes give the error")
    parser.add_argument("--size", default=None, help="WxH; the shot's own size if missing")
    parser.add_argument("--out", required=True, help=".npy, .pfm or .exr; with --layer all, the layer's name is put in front of the suffix")
    parser.add_argument("--bounces", type=int, default=4, help="surfaces between light and eye at most (1 + VPL bounces)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--integrator", choices=("volpath", "path"), default="volpath")
    parser.add_argument("--face-normals", action="store_true", help="ignore the file's normals: shows what smooth normals do")
    parser.add_argument("--variant", default=None)
    parser.add_argument("--threads", type=int, default=0)
    args = parser.parse_args()

    variant = args.variant or ("llvm_ad_rgb" if find_llvm() else "scalar_rgb")
    import mitsuba as mi
    mi.set_variant(variant)
    if args.threads and variant.startswith("llvm"):
        import drjit
        drjit.set_thread_count(args.threads)
    shot = pathlib.Path(args.shot)
    if not shot.exists():
        shot = args.scenes / "shots" / (args.shot.removesuffix(".json") + ".json")
    camera = json.load(open(shot))["camera"]
    size = tuple(map(int, args.size.split("x"))) if args.size else (camera["width"], camera["height"])

    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        scene = build(mi, shot, size, folder, args.face_normals)
    print(f"{variant}, {args.integrator}: loaded in {time.perf_counter() - started:.1f} s", file=sys.stderr)

    layers = LAYERS if args.layer == "all" else (args.layer,)
    depths = sorted({d for layer in layers for _, d in depth_terms(layer, args.bounces)})
    integrators = {d: mi.load_dict({"type": args.integrator, "max_depth": d, "rr_depth": 1000}) for d in depths}
    passes = max(1, args.spp // args.pass_spp)
    spp = args.spp // passes
    total = {layer: np.zeros((size[1], size[0], 3)) for layer in layers}
    square = {layer: np.zeros((size[1], size[0], 3)) for layer in layers}
    energy = {layer: [] for layer in layers}
    seconds = {d: 0.0 for d in depths}
    for i in range(passes):
        image = {}
        for d in depths:
            # One seed for all depths: the shared part of the paths is the same and cancels in the differences.
            started = time.perf_counter()
            image[d] = np.array(mi.render(scene, integrator=integrators[d], spp=spp, seed=args.seed * 100003 + i), np.float64)
            seconds[d] += time.perf_counter() - started
        for layer in layers:
            picture = sum(f * image[d] for f, d in depth_terms(layer, args.bounces))
            total[layer] += picture
            square[layer] += picture ** 2
            energy[layer].append(picture.mean())
        if sys.stderr.isatty():
            print(f"\rpass {i + 1}/{passes}", end="", file=sys.stderr)

    report = {"shot": shot.stem, "size": size, "spp": spp * passes, "passes": passes, "bounces": args.bounces,
              "integrator": args.integrator, "variant": variant, "mitsuba": mi.__version__,
              "mpaths_per_s": {d: round(size[0] * size[1] * spp * passes / s / 1e6, 3) for d, s in seconds.items()},
              "seconds": {d: round(s, 1) for d, s in seconds.items()}}
    for layer in layers:
        out = pathlib.Path(args.out)
        if args.layer == "all":
            out = out.with_name(f"{out.stem}.{layer}{out.suffix}")
        mean = total[layer] / passes
        save(mi, out, mean.astype(np.float32))
        line = {"layer": layer, "energy": float(np.mean(energy[layer])), "min": float(mean.min()), "max": float(mean.max())}
        if passes > 1:
            variance = np.maximum(square[layer] / passes - mean ** 2, 0) / (passes - 1)
            line["energy_standard_error"] = float(np.std(energy[layer], ddof=1) / passes ** 0.5)
            # What relMSE this noise alone would show against a noise-free picture.
            line["noise_relmse"] = float((variance / (mean ** 2 + 0.01 * mean.mean() ** 2)).mean())
            np.save(out.with_name(out.stem + ".se.npy"), np.sqrt(variance).astype(np.float32))
        line |= report
        json.dump(line, open(out.with_name(out.stem + ".json"), "w"), indent=1)
        print(json.dumps(line))


if __name__ == "__main__":
    main()
