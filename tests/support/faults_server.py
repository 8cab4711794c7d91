"""What the server of `faults` does before it forks: operations load and compile what they use."""

import contextlib
import io
import tempfile
from pathlib import Path

from faults import OPERATIONS, make_inputs

with tempfile.TemporaryDirectory() as home, contextlib.redirect_stdout(io.StringIO()):
    make_inputs(Path(home) / "inputs", 0)
    for operation in OPERATIONS.values():
        operation(Path(home) / "inputs", Path(home))
