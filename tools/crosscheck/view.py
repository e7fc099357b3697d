"""Tone-maps float pictures to one PNG, side by side: python view.py OUT.png A.npy B.npy …"""
import sys

import numpy as np
from PIL import Image

from compare import load


def tone(image):
    """Exposed so that the mean lands on 0.18, then rolled off and sRGB coded."""
    x = np.maximum(image, 0) * 0.18 / max(np.minimum(image, np.percentile(image, 99)).mean(), 1e-8)
    x = 1 - np.exp(-1.5 * x)
    return (np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055) * 255 + 0.5).astype(np.uint8)


if __name__ == "__main__":
    Image.fromarray(np.concatenate([tone(load(p)) for p in sys.argv[2:]], 1)).save(sys.argv[1])
