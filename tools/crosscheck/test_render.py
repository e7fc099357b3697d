"""Known answers for render_mitsuba.py: python test_render.py (about half a minute).
A floor of two by two units under small made-up lights; each picture is compared with a value worked out by hand."""
import io
import json
import pathlib
import struct
import subprocess
import sys
import tempfile

import numpy as np
from PIL import Image

HERE = pathlib.Path(__file__).parent


def quad(center, u, v):
    c, u, v = map(np.array, (center, u, v))
    return np.array([c - u - v, c + u - v, c + u + v, c - u + v], "<f4")


def write_glb(path, quads, materials, image=None):
    """quads: (corners, material); texture coordinates run 0..1 along u and, downwards in the image, along v."""
    blob, views, accessors, meshes = b"", [], [], []

    def add(data, **accessor):
        nonlocal blob
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(data)})
        blob += data + b"\0" * (-len(data) % 4)
        if accessor:
            accessors.append({"bufferView": len(views) - 1, **accessor})
        return len(accessors) - 1

    uv = add(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], "<f4").tobytes(), componentType=5126, count=4, type="VEC2")
    index = add(np.array([0, 1, 2, 0, 2, 3], "<u2").tobytes(), componentType=5123, count=6, type="SCALAR")
    for corners, material in quads:
        p = add(corners.tobytes(), componentType=5126, count=4, type="VEC3")
        meshes.append({"primitives": [{"attributes": {"POSITION": p, "TEXCOORD_0": uv}, "indices": index, "material": material}]})
    doc = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(len(meshes)))}],
           "nodes": [{"mesh": i} for i in range(len(meshes))], "meshes": meshes, "materials": materials,
           "accessors": accessors, "bufferViews": views}
    if image is not None:
        file = io.BytesIO()
        Image.fromarray(image).save(file, "png")
        add(file.getvalue())
        doc |= {"images": [{"bufferView": len(views) - 1, "mimeType": "image/png"}], "textures": [{"source": 0, "sampler": 0}],
                "samplers": [{"wrapS": 33071, "wrapT": 33071}]}
    doc["buffers"] = [{"byteLength": len(blob)}]
    text = json.dumps(doc).encode()
    text += b" " * (-len(text) % 4)
    with open(path, "wb") as out:
        out.write(struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + len(blob), len(text), 0x4E4F534A) + text)
        out.write(struct.pack("<II", len(blob), 0x004E4942) + blob)


def picture(folder, quads, materials, lights, layer, image=None, spp=64):
    """Looking straight down on the floor from 10 above, -z at the top; exactly the floor fills the picture."""
    write_glb(folder / "s.glb", quads, materials, image)
    shot = {"scene": "s.glb", "lights": lights,
            "camera": {"position": [0, 10, 0], "target": [0, 0, 0], "up": [0, 0, -1],
                       "vfov_deg": 2 * np.degrees(np.arctan(0.1)), "width": 16, "height": 16}}
    (folder / "s.json").write_text(json.dumps(shot))
    subprocess.run([sys.executable, str(HERE / "render_mitsuba.py"), str(folder / "s.json"), "--layer", layer, "--spp", str(spp),
                    "--out", str(folder / "o.npy")], check=True, capture_output=True)
    return np.load(folder / "o.npy")


def check(name, got, want, tolerance=0.01):
    error = np.abs(np.asarray(got) - want).max() / max(np.abs(want).max(), 1e-9)
    print(f"{'ok  ' if error <= tolerance else 'FAIL'} {name}: got {np.round(got, 5)}, expected {np.round(want, 5)}")
    return error <= tolerance


def main():
    floor = quad((0, 0, 0), (1, 0, 0), (0, 0, -1))
    lid = quad((0, 1, 0), (5, 0, 0), (0, 0, -5))
    grey = {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 0.125, 1], "metallicFactor": 1}}
    white = np.array([0.5, 0.25, 0.125])
    sun = {"type": "sun", "direction": [0, -2, 0], "irradiance": [3, 3, 3]}
    passed = []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        image = picture(folder, [(floor, 0)], [grey], [sun], "direct")
        passed.append(check("sun on a floor", image.mean((0, 1)), white * 3 / np.pi))
        slant = {"type": "sun", "direction": [3 ** 0.5, -1, 0], "irradiance": [3, 3, 3]}
        image = picture(folder, [(floor, 0)], [grey], [slant], "direct")
        passed.append(check("sun at 60 degrees", image.mean((0, 1)), white * 1.5 / np.pi))
        image = picture(folder, [(floor, 0)], [grey], [{"type": "sky", "radiance": [2, 2, 2]}], "direct", spp=512)
        passed.append(check("sky on a floor", image.mean((0, 1)), white * 2))
        image = picture(folder, [(floor, 0)], [grey], [{"type": "point", "position": [0, 100, 0], "intensity": [1e4] * 3}], "direct")
        passed.append(check("point light", image.mean((0, 1)), white / np.pi))

        # A lid that lets 3/4 of the light through; the camera looks through it as well.
        veil = {"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 0.25]}}
        image = picture(folder, [(floor, 0), (lid, 1)], [grey, veil], [sun], "direct", spp=2048)
        passed.append(check("sun through a BLEND lid", image.mean((0, 1)), white * 3 / np.pi * 0.75 ** 2, 0.02))
        image = picture(folder, [(floor, 0), (lid, 1)], [grey, veil], [sun], "indirect")
        passed.append(check("a black lid reflects nothing", image.mean((0, 1)), np.zeros(3), 1e-6))

        # A texture: red top left, green top right, blue bottom left, clear bottom right.
        # The floor's v axis points away from the top (-z), so image row 0 lies at +z, the bottom of the picture.
        texels = np.zeros((64, 64, 4), np.uint8)
        texels[:32, :32] = 188, 0, 0, 255
        texels[:32, 32:] = 0, 188, 0, 255
        texels[32:, :32] = 0, 0, 188, 255
        textured = {"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
        image = picture(folder, [(floor, 0)], [textured], [sun], "direct", image=texels)
        half = ((188 / 255 + 0.055) / 1.055) ** 2.4 * 3 / np.pi
        spots = np.array([image[12, 3], image[12, 12], image[3, 3], image[3, 12]])
        passed.append(check("texture, orientation and sRGB", spots, np.array([[half, 0, 0], [0, half, 0], [0, 0, half], [0, 0, 0]])))
        below = quad((0, -0.01, 0), (1, 0, 0), (0, 0, -1))
        image = picture(folder, [(floor, 0), (below, 1)], [textured, grey], [sun], "direct", image=texels)
        passed.append(check("sun through a MASK hole", image[3, 12], white * 3 / np.pi))

        # Emission: a lamp facing down lights the floor, one facing up shows its front to the camera.
        lamp = {"name": "lamp", "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]}, "emissiveFactor": [1, 1, 1]}
        shine = [{"type": "emissive", "material": "lamp", "radiance": [4, 4, 4]}]
        up, down = quad((0, 0, 0), (2, 0, 0), (0, 0, -2)), quad((0, 0, 0), (2, 0, 0), (0, 0, 2))
        passed.append(check("emission seen from the front", picture(folder, [(up, 0)], [lamp], shine, "emission").mean((0, 1)), np.full(3, 4.0)))
        passed.append(check("no emission at the back", picture(folder, [(down, 0)], [lamp], shine, "emission").mean((0, 1)), np.zeros(3), 1e-6))

        # Two large parallel plates, the upper one a lamp of half albedo seen from outside: depth by depth.
        high = quad((0, 30, 0), (3000, 0, 0), (0, 0, 3000))
        wide = quad((0, 0, 0), (3000, 0, 0), (0, 0, -3000))
        lamp_half = lamp | {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1]}}
        grey_half = {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1]}}
        plates = [(wide, 0), (high, 1)]
        # E on the floor is pi L; reflected 0.5 L; every further pair of reflections adds a quarter of that.
        passed.append(check("plates, one surface", picture(folder, plates, [grey_half, lamp_half], shine, "direct", spp=512).mean((0, 1)), np.full(3, 2.0), 0.02))
        passed.append(check("plates, two to four surfaces", picture(folder, plates, [grey_half, lamp_half], shine, "indirect", spp=512).mean((0, 1)), np.full(3, 0.5), 0.03))
    if not all(passed):
        sys.exit(f"{passed.count(False)} of {len(passed)} failed")


if __name__ == "__main__":
    main()
