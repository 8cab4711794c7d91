"""Progress bars."""

from __future__ import annotations

from tqdm import tqdm


class ProgressBar(tqdm):
    """A progress bar that can be interrupted during its construction without an error."""

    # Before tqdm 4.70, the destructor reads this attribute, which the constructor sets late.
    disable = True
