"""Compares a picture with a reference: python compare.py PICTURE REFERENCE [--layer L] [-o diff.png]
Reads .npy, .pfm and .exr (a manylight layer with --layer; needs mitsuba, no variant or LLVM)."""
import argparse
import json
import pathlib

import numpy as np
from PIL import Image


def load(path, layer=None):
    path = pathlib.Path(path)
    if path.suffix == ".npy":
        return np.load(path).astype(np.float64)
    if path.suffix == ".pfm":
        with open(path, "rb") as file:
            kind, size, scale = file.readline().strip(), file.readline().split(), float(file.readline())
            data = np.frombuffer(file.read(), "<f4" if scale < 0 else ">f4")
        return data.reshape(int(size[1]), int(size[0]), 3 if kind == b"PF" else 1)[::-1].astype(np.float64)
    import mitsuba as mi
    if mi.variant() is None:
        mi.set_variant("scalar_rgb")
    bitmap = mi.Bitmap(str(path))
    names = [bitmap.struct_()[i].name for i in range(bitmap.channel_count())]
    wanted = [f"{layer}.{c}" if layer else c for c in "RGB"]
    if not all(w in names for w in wanted):
        raise SystemExit(f"{path}: no channels {wanted}; there are {names}")
    data = np.array(bitmap, np.float64).reshape(bitmap.height(), bitmap.width(), -1)
    return data[..., [names.index(w) for w in wanted]]


def errors(a, b):
    square = (a - b) ** 2
    return {"energy": a.mean(), "reference_energy": b.mean(), "energy_bias": (a - b).mean() / b.mean(),
            "energy_bias_rgb": ((a - b).mean((0, 1)) / b.mean((0, 1))).tolist(),
            "rmse": square.mean() ** 0.5, "relmse": (square / (b ** 2 + 0.01 * b.mean() ** 2)).mean(),
            "mape": (abs(a - b) / (abs(b) + 0.01 * b.mean())).mean()}


def signed_picture(a, b, reach):
    """Red: brighter than the reference; blue: darker; white: equal. Saturates at `reach` times the local value."""
    d = (a - b).mean(2) / (b.mean(2) + 0.1 * b.mean())
    t = np.clip(d / reach, -1, 1)
    rgb = np.stack([1 - np.maximum(-t, 0), 1 - abs(t), 1 - np.maximum(t, 0)], 2)
    return Image.fromarray((rgb * 255 + 0.5).astype(np.uint8))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("picture")
    parser.add_argument("reference")
    parser.add_argument("--layer", help="layer of an EXR picture")
    parser.add_argument("--reference-layer", help="layer of an EXR reference")
    parser.add_argument("-o", "--out", help="signed difference as PNG")
    parser.add_argument("--reach", type=float, default=0.5, help="relative difference at full colour")
    args = parser.parse_args()
    a, b = load(args.picture, args.layer), load(args.reference, args.reference_layer)
    if a.shape != b.shape:
        raise SystemExit(f"sizes differ: {a.shape} and {b.shape}")
    result = errors(a, b)
    # With standard errors beside the files (render_mitsuba.py), say how much of the difference noise explains.
    noise = 0.0
    for name in (args.picture, args.reference):
        path = pathlib.Path(name)
        if path.with_name(path.stem + ".se.npy").exists():
            noise = noise + np.load(path.with_name(path.stem + ".se.npy")).astype(np.float64) ** 2
    if np.ndim(noise):
        result["relmse_explained_by_noise"] = (noise / (b ** 2 + 0.01 * b.mean() ** 2)).mean()
    print(json.dumps(result, indent=1))
    if args.out:
        signed_picture(a, b, args.reach).save(args.out)


if __name__ == "__main__":
    main()
