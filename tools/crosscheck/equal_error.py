"""How long others take for the error of one filtered frame: path tracing, and path tracing plus Open Image Denoise.

python equal_error.py SHOT --program PATH [--size WxH] [--set PATH=VALUE]... [--folder FOLDER] [--out FILE.json]

Everything is judged on the indirect layer, by relMSE over a few windows of the picture, against a reference of many
paths per pixel in those windows (kept in FOLDER). The noise of the reference, known from its passes, is taken off.
Path tracing is unbiased, so its error is C/N at N paths per pixel; C is measured at two N. Times are of whole pictures
on the same threads in the same run: frame by `bench`, paths by rendering the whole picture, the denoiser by the clock.
"""
import argparse
import ctypes
import json
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np

from compare import load
from render_mitsuba import build, depth_terms, find_llvm

BOUNCES = 4
PASS_SPP = 32
WINDOW = (160, 90)


def windows(size):
    """Six windows, in the middle of the cells of a 3 × 2 division."""
    w, h = min(WINDOW[0], size[0] // 3), min(WINDOW[1], size[1] // 2)
    return [((2 * i + 1) * size[0] // 6 - w // 2, (2 * j + 1) * size[1] // 4 - h // 2, w, h)
            for j in range(2) for i in range(3)]


class Paths:
    def __init__(self, mi, shot, size):
        with tempfile.TemporaryDirectory() as folder:
            self.scene = build(mi, shot, size, folder, False)
        self.mi, self.size = mi, size
        self.terms = depth_terms("indirect", BOUNCES)
        self.integrators = {d: mi.load_dict({"type": "volpath", "max_depth": d, "rr_depth": 1000}) for _, d in self.terms}

    def look(self, window):
        film = self.mi.traverse(self.scene.sensors()[0])
        film["film.crop_offset"] = self.mi.ScalarPoint2u(window[:2])
        film["film.crop_size"] = self.mi.ScalarVector2u(window[2:])
        film.update()

    def indirect(self, spp, seed):
        """The layer, and the seconds of its deepest term alone: one render would do for the whole picture."""
        image, seconds = 0.0, {}
        for factor, depth in self.terms:
            started = time.perf_counter()
            image = image + factor * np.array(
                self.mi.render(self.scene, integrator=self.integrators[depth], spp=spp, seed=seed), np.float64)
            seconds[depth] = time.perf_counter() - started
        return image, seconds[max(seconds)]

    def guides(self, spp):
        aovs = self.mi.load_dict({"type": "aov", "aovs": "albedo:albedo,normal:sh_normal"})
        image = np.array(self.mi.render(self.scene, integrator=aovs, spp=spp, seed=7), np.float32)
        return [np.ascontiguousarray(image[..., -6:-3]), np.ascontiguousarray(image[..., -3:])]


def denoise(image, guides):
    import oidn
    device = oidn.NewDevice()
    oidn.CommitDevice(device)
    out = np.zeros_like(image)
    started = time.perf_counter()
    task = oidn.NewFilter(device, "RT")
    names = ("color", "albedo", "normal", "output")
    for name, data in zip(names, (image, *guides, out)):
        oidn.SetSharedFilterImage(task, name, data, oidn.FORMAT_FLOAT3, data.shape[1], data.shape[0])
    # The package does not wrap flags.
    library = ctypes.CDLL(str(next(pathlib.Path(oidn.__file__).parent.glob("lib*/libOpenImageDenoise.so*"))))
    library.oidnSetFilter1b(ctypes.c_void_p(task), b"hdr", ctypes.c_bool(True))
    oidn.CommitFilter(task)
    oidn.ExecuteFilter(task)
    seconds = time.perf_counter() - started
    error = oidn.GetDeviceError(device)
    if error != oidn.ERROR_NONE:
        sys.exit(f"Open Image Denoise: {error}")
    oidn.ReleaseFilter(task)
    oidn.ReleaseDevice(device)
    return out, seconds


class Judge:
    def __init__(self, paths, spp, file):
        self.windows = windows(paths.size)
        if file.exists():
            stored = np.load(file)
            self.mean, self.variance = stored["mean"], stored["variance"]
        else:
            total, square, passes = 0.0, 0.0, spp // PASS_SPP
            for i in range(passes):
                picture = self.cut(paths, PASS_SPP, 1000 + i)
                total, square = total + picture, square + picture ** 2
                if sys.stderr.isatty():
                    print(f"\rreference {i + 1}/{passes}", end="", file=sys.stderr)
            self.mean = total / passes
            self.variance = np.maximum(square / passes - self.mean ** 2, 0) / (passes - 1)
            np.savez(file, mean=self.mean, variance=self.variance)
        self.scale = self.mean ** 2 + 0.01 * self.mean.mean() ** 2
        self.noise = (self.variance / self.scale).mean()

    def cut(self, paths, spp, seed):
        out = []
        for window in self.windows:
            paths.look(window)
            out.append(paths.indirect(spp, seed)[0])
        paths.look((0, 0, *paths.size))
        return np.stack(out)

    def error(self, cut):
        return float(((cut - self.mean) ** 2 / self.scale).mean() - self.noise)

    def of_whole(self, image):
        return np.stack([image[y:y + h, x:x + w] for x, y, w, h in self.windows])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shot", type=pathlib.Path)
    parser.add_argument("--program", required=True, help="manylight")
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--set", action="append", default=[], help="settings of the frame")
    parser.add_argument("--reference-spp", type=int, default=1024)
    parser.add_argument("--spp", type=int, default=64, help="most paths per pixel to denoise")
    parser.add_argument("--folder", type=pathlib.Path, default=pathlib.Path("."))
    parser.add_argument("--out", type=pathlib.Path)
    args = parser.parse_args()
    size = tuple(map(int, args.size.split("x")))
    settings = [x for s in ["surface.normal_maps=false", *args.set] for x in ("--set", s)]

    import mitsuba as mi
    mi.set_variant("llvm_ad_rgb" if find_llvm() else "scalar_rgb")
    paths = Paths(mi, args.shot, size)
    judge = Judge(paths, args.reference_spp, args.folder / f"{args.shot.stem}-{args.size}-{args.reference_spp}.npz")

    # The frame.
    picture = args.folder / f"{args.shot.stem}-frame.exr"
    common = [str(args.shot), "--size", args.size, *settings]
    subprocess.run([args.program, "render", *common, "-o", str(picture), "--quiet"], check=True)
    timed = subprocess.run([args.program, "bench", *common, "--json", "--frames", "5"], check=True, stdout=subprocess.PIPE)
    frame_s = json.loads(timed.stdout)[0]["report"]["frame"]["median_ms"] / 1000
    frame = judge.of_whole(load(picture, "indirect"))
    frame_error = judge.error(frame)

    # Paths.
    constants = [judge.error(judge.cut(paths, n, 5000 + n)) * n for n in (64, 128)]
    _, seconds = paths.indirect(8, 3)
    spp_s = seconds / 8
    equal_spp = float(np.mean(constants)) / frame_error
    report = {"shot": args.shot.stem, "size": size, "settings": args.set, "variant": mi.variant(),
              "reference_spp": args.reference_spp, "reference_noise": judge.noise,
              "frame": {"seconds": frame_s, "relmse": frame_error,
                        "energy_bias": float((frame - judge.mean).mean() / judge.mean.mean())},
              "paths": {"relmse_times_spp": constants, "seconds_per_spp": spp_s, "equal_spp": equal_spp,
                        "equal_seconds": equal_spp * spp_s, "times_slower": equal_spp * spp_s / frame_s}}

    # Paths and a denoiser.
    guides = paths.guides(16)
    report["denoised"] = []
    spp = 1
    while spp <= args.spp:
        image, seconds = paths.indirect(spp, 11)
        clean, denoise_s = denoise(np.ascontiguousarray(np.maximum(image, 0), np.float32), guides)
        error = judge.error(judge.of_whole(clean.astype(np.float64)))
        report["denoised"].append({"spp": spp, "relmse": error, "seconds": spp * spp_s + denoise_s, "denoise_seconds": denoise_s,
                                   "noisy_relmse": judge.error(judge.of_whole(image))})
        if error <= frame_error:
            report["denoised_times_slower"] = (spp * spp_s + denoise_s) / frame_s
            break
        spp *= 2
    text = json.dumps(report, indent=1)
    print(text)
    if args.out:
        args.out.write_text(text + "\n")


if __name__ == "__main__":
    main()
