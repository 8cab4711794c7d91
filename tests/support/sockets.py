"""Where processes can put their sockets, whose paths have at most some hundred bytes."""

import os
import tempfile

_LONGEST = 60  # bytes; programs append names of their own


def folder_of_sockets() -> str:
    """Return the folder of temporary files or, where its path is too long, that of all Unix."""
    folder = tempfile.gettempdir()
    return folder if len(os.fsencode(folder)) <= _LONGEST else "/tmp"
