"""Progress bars."""

from __future__ import annotations

from tqdm import tqdm


class ProgressBar(tqdm):
    """A bar that ends without a word where it was interrupted before it was whole."""

    # Before tqdm 4.70, the end of a bar asks for this, which is set no sooner than it is whole.
    disable = True
