"""A small glTF 2.0 binary reader for the crosscheck: numpy and json only, written apart from the Rust reader on purpose."""
import io
import json
import struct

import numpy as np
from PIL import Image

COMPONENT = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Glb:
    def __init__(self, path):
        data = open(path, "rb").read()
        if data[:4] != b"glTF":
            raise ValueError(f"{path} is not a binary glTF file")
        length = struct.unpack_from("<I", data, 12)[0]
        self.doc = json.loads(data[20:20 + length])
        self.bin = data[20 + length + 8:]

    def view_bytes(self, index):
        view = self.doc["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self.bin[start:start + view["byteLength"]], view.get("byteStride")

    def accessor(self, index):
        acc = self.doc["accessors"][index]
        if "sparse" in acc:
            raise ValueError(f"accessor {index} is sparse: not supported here")
        dtype = np.dtype(COMPONENT[acc["componentType"]]).newbyteorder("<")
        width, count = WIDTH[acc["type"]], acc["count"]
        raw, stride = self.view_bytes(acc["bufferView"])
        out = np.ndarray((count, width), dtype, raw, acc.get("byteOffset", 0),
                         (stride or width * dtype.itemsize, dtype.itemsize)).copy()
        if acc.get("normalized"):
            out = np.maximum(out.astype(np.float32) / np.iinfo(dtype).max, -1.0)
        return out

    def image(self, index):
        """RGBA as float in 0..1, still sRGB coded, row 0 at the top."""
        raw, _ = self.view_bytes(self.doc["images"][index]["bufferView"])
        return np.asarray(Image.open(io.BytesIO(raw)).convert("RGBA"), np.float32) / 255.0

    def local_matrix(self, node):
        if "matrix" in node:
            return np.array(node["matrix"], np.float64).reshape(4, 4).T
        x, y, z, w = node.get("rotation", (0, 0, 0, 1))
        rotation = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                             [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                             [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
        out = np.eye(4)
        out[:3, :3] = rotation * np.array(node.get("scale", (1, 1, 1)), np.float64)
        out[:3, 3] = node.get("translation", (0, 0, 0))
        return out

    def world_matrices(self):
        """World matrix of every node of the default scene, by node index."""
        nodes, out = self.doc["nodes"], {}
        stack = [(n, np.eye(4)) for n in self.doc["scenes"][self.doc.get("scene", 0)]["nodes"]]
        while stack:
            index, parent = stack.pop()
            out[index] = parent @ self.local_matrix(nodes[index])
            stack += [(c, out[index]) for c in nodes[index].get("children", ())]
        return out

    def triangles(self):
        """Yields one dict per primitive and instance: material, corner arrays position/normal [n,3,3], uv [n,3,2],
        colour [n,3,3] or None, all in world space, rest pose, counter-clockwise seen from the front."""
        world = self.world_matrices()
        for index, matrix in sorted(world.items()):
            node = self.doc["nodes"][index]
            if "mesh" not in node:
                continue
            joints = None
            if "skin" in node:
                skin = self.doc["skins"][node["skin"]]
                bind = (self.accessor(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
                        if "inverseBindMatrices" in skin else np.eye(4)[None].repeat(len(skin["joints"]), 0))
                joints = np.stack([world[j] @ b for j, b in zip(skin["joints"], bind)])
            for prim in self.doc["meshes"][node["mesh"]]["primitives"]:
                if prim.get("mode", 4) == 4:
                    yield self.primitive(prim, matrix, joints)

    def primitive(self, prim, matrix, joints):
        get = lambda name: self.accessor(prim["attributes"][name]) if name in prim["attributes"] else None
        position, normal, uv, colour = get("POSITION").astype(np.float64), get("NORMAL"), get("TEXCOORD_0"), get("COLOR_0")
        if joints is not None and "JOINTS_0" in prim["attributes"]:
            weight = get("WEIGHTS_0").astype(np.float64)
            weight /= weight.sum(1, keepdims=True)
            blend = np.einsum("vk,vkij->vij", weight, joints[get("JOINTS_0").astype(int)])
        else:
            blend = np.broadcast_to(matrix, (len(position), 4, 4))
        position = np.einsum("vij,vj->vi", blend[:, :3, :3], position) + blend[:, :3, 3]
        faces = self.accessor(prim["indices"]).reshape(-1).astype(np.int64) if "indices" in prim else np.arange(len(position))
        faces = faces[:len(faces) // 3 * 3].reshape(-1, 3)
        if np.linalg.det(matrix[:3, :3]) < 0 and joints is None:
            faces = faces[:, ::-1]
        corner = position[faces]
        face_normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        length = np.linalg.norm(face_normal, axis=1)
        keep = np.isfinite(corner).all((1, 2)) & (length > 1e-14)
        faces, corner, face_normal = faces[keep], corner[keep], face_normal[keep] / length[keep, None]
        flat = np.repeat(face_normal[:, None], 3, 1)
        if normal is None:
            smooth = flat
        else:
            normal = np.einsum("vij,vj->vi", cofactor(blend[:, :3, :3]), normal.astype(np.float64))
            size = np.linalg.norm(normal, axis=1, keepdims=True)
            smooth = (normal / np.maximum(size, 1e-30))[faces]
            smooth = np.where((size < 1e-30)[faces] | ~np.isfinite(smooth), flat, smooth)
        return {"material": prim.get("material"), "position": corner, "normal": smooth, "flat": flat,
                "uv": np.zeros((len(faces), 3, 2)) if uv is None else uv[faces],
                "colour": None if colour is None else colour[faces][..., :3], "dropped": int((~keep).sum())}


def cofactor(m):
    """The matrices that carry normals: inverse transpose times determinant, without a division.
    The sign is made that of a rotation, so a mirrored node keeps its normals on the outside."""
    a, b, c = m[:, 0], m[:, 1], m[:, 2]
    out = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], 1)
    return out * np.sign(np.linalg.det(m))[:, None, None]
