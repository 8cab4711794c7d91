"""Pictures and interactive views of bodies, paths, motions and results."""

import lazy_loader

# The names of __init__.pyi, each loaded on first use: most commands need few of them.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
