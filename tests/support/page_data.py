"""What pages with viewers hold, as their scripts read it."""

import base64
import json
import re
import zlib

import numpy as np


def data_of(viewer):
    """Return the data of a viewer."""
    found = re.search(r'data-part="data">(.*?)</script>', viewer.fragment("one"), re.DOTALL)
    return json.loads(found[1])


def inflated(text, dtype):
    """Return the numbers of a compressed array."""
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), dtype)


def unpacked(text, dtype, width):
    """Return rows of whole numbers as the script of the page restores them."""
    size = np.dtype(dtype).itemsize
    planes = inflated(text, np.uint8).reshape(size, -1).astype(dtype)
    differences = sum(plane << dtype(8 * byte) for byte, plane in enumerate(planes))
    return np.cumsum(differences.reshape(-1, width), axis=0, dtype=dtype)
