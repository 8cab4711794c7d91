"""The report of the paper's experiments, the page of registered scans, and people's sheets."""

import lazy_loader

# The names of __init__.pyi, each loaded on first use.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
