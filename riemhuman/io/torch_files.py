"""Files of PyTorch (.pt, .pth), read as data: archives of a pickle and the numbers of tensors."""

from __future__ import annotations

import zipfile
from pathlib import Path

from riemhuman.errors import FileFormatError
from riemhuman.io.arrays import memory_limit
from riemhuman.io.files import check_file, format_errors
from riemhuman.io.pickles import Unpickled, pickled_tree

_PICKLE = "data.pkl"
_DATA = "data/"
_ORDER = "byteorder"


def load_torch_tree(file: Path) -> Unpickled:
    """Return the dictionaries, lists, tensors, numbers and texts in a file; nothing in it runs."""
    size = check_file(file)
    with format_errors(file, "a file of PyTorch"):
        if not zipfile.is_zipfile(file):
            raise FileFormatError(
                "not in PyTorch's format since version 1.6; save it again with torch.save"
            )
        with zipfile.ZipFile(file) as archive:
            members = {member.filename: member for member in archive.infolist()}
            if sum(member.file_size for member in members.values()) > memory_limit(size):
                raise FileFormatError("would take far more memory than a file of this size should")
            # All names begin with a folder, which may have any name.
            folder = next(
                (name.removesuffix(_PICKLE) for name in members if name.endswith("/" + _PICKLE)),
                None,
            )
            if folder is None:
                raise FileFormatError(f"holds no {_PICKLE}")
            prefix = folder + _DATA
            storages = {
                name.removeprefix(prefix): archive.read(member)
                for name, member in members.items()
                if name.startswith(prefix)
            }
            order = folder + _ORDER
            is_little = order not in members or archive.read(order).strip() == b"little"
            return pickled_tree(archive.read(folder + _PICKLE), storages, is_little, size)
