"""Files as PyTorch writes them, sound and malformed, without PyTorch."""

import zipfile

import numpy as np
from model_pickles import Call, Raw, name_of, pickled


class Tensor:
    """An array that is written as a tensor of PyTorch, with its entries in a storage."""

    def __init__(self, array, kind="DoubleStorage", strides=None, offset=0, shape=None):
        self.array, self.kind, self.offset = np.ascontiguousarray(array), kind, offset
        self.shape = array.shape if shape is None else shape
        steps = [step // self.array.itemsize for step in self.array.strides]
        self.strides = steps if strides is None else strides


def torch_file(path, content, folder="archive", byteorder="little"):
    """Write nested dictionaries of tensors as `torch.save` does."""
    storages = []

    def opcodes(value):
        if isinstance(value, dict):
            return {key: opcodes(item) for key, item in value.items()}
        if not isinstance(value, Tensor):
            return value
        storages.append(value.array.tobytes())
        numbers = str(len(storages) - 1)
        identifier = ("storage", name_of(f"torch {value.kind}"), numbers, "cpu", value.array.size)
        stored = Raw(pickled(identifier)[2:-1] + b"Q")
        shape, strides = tuple(value.shape), tuple(value.strides)
        arguments = (
            stored,
            value.offset,
            shape,
            strides,
            False,
            Call("collections OrderedDict", ()),
        )
        return Call("torch._utils _rebuild_tensor_v2", arguments)

    data = pickled(opcodes(content))
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(f"{folder}/data.pkl", data)
        archive.writestr(f"{folder}/byteorder", byteorder)
        for number, storage in enumerate(storages):
            archive.writestr(f"{folder}/data/{number}", storage)
    return path
