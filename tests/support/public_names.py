"""The public names of the library: what the top level and its subpackages list in `__all__`."""

import importlib
import inspect

import riemhuman


def public_objects():
    """Return every public class, function and constant by its shortest dotted name."""
    objects = {}
    packages = [name for name in riemhuman.__all__ if inspect.ismodule(getattr(riemhuman, name))]
    for package in ("riemhuman", *(f"riemhuman.{name}" for name in packages)):
        module = importlib.import_module(package)
        for name in getattr(module, "__all__", ()):
            value = getattr(module, name)
            if not inspect.ismodule(value) and not any(value is seen for seen in objects.values()):
                objects[f"{package}.{name}"] = value
    return objects
