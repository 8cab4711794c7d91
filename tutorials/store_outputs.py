"""Run the notebooks and keep what they show: `python tutorials/store_outputs.py [NUMBER ...]`.

Pictures are kept at most 900 pixels wide and with 96 colours. Of a viewer, the bodies that it shows
are kept, without the scripts that draw them: the documentation site holds these once.
"""

from __future__ import annotations

import base64
import html
import io
import os
import re
import shutil
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from unittest import mock

import nbclient
import nbformat
from nbformat import NotebookNode
from PIL import Image

FOLDER = Path(__file__).parent
_FOUND = find_spec("riemhuman")
LIBRARY = Path(_FOUND.origin).parents[1] if _FOUND else FOLDER.parent
VIEWER = "application/vnd.riemhuman.viewer+html"
# Of whatever hangs; on a busy machine, a cell may take many times as long as on an idle one.
SECONDS_A_CELL, SECONDS_TO_START = 1200, 300


def executed(path: Path) -> NotebookNode:
    """Return a notebook with its outputs, after it has run in a process and a folder of its own.

    The folder holds the recordings that are beside the notebooks; the library is the one
    that is installed, if it is.
    """
    notebook = nbformat.read(path, as_version=nbformat.NO_CONVERT)
    left_out = ("MPLBACKEND", "OPENBLAS_NUM_THREADS", "PYTHONWARNINGS")
    variables = {name: value for name, value in os.environ.items() if name not in left_out}
    with (
        tempfile.TemporaryDirectory() as folder,
        mock.patch.dict(os.environ, variables | {"PYTHONPATH": str(LIBRARY)}, clear=True),
    ):
        shutil.copytree(FOLDER / "recordings", Path(folder) / "recordings")
        nbclient.NotebookClient(
            notebook,
            timeout=SECONDS_A_CELL,
            startup_timeout=SECONDS_TO_START,
            kernel_name="python3",
            resources={"metadata": {"path": folder}},
        ).execute()
    return notebook


def small(notebook: NotebookNode) -> NotebookNode:
    """Return an executed notebook as it is kept: small pictures, viewers without scripts."""
    notebook.metadata.pop("widgets", None)
    for cell in notebook.cells:
        if cell.cell_type != "code":
            continue
        cell.metadata, cell.execution_count = NotebookNode(), None
        cell.outputs = joined(cell.outputs)
        for output in cell.outputs:
            if "execution_count" in output:
                output.execution_count = None
            sizes = output.get("metadata", {})
            if "image/png" in sizes:  # a narrow picture is not shown as wide as the page
                sizes["image/png"] = NotebookNode(width=sizes["image/png"]["width"])
            data = output.get("data", {})
            if "image/png" in data:
                data["image/png"] = few_colours(data["image/png"])
            if "<iframe" in data.get("text/html", ""):
                data[VIEWER] = fragment(data.pop("text/html"))
    return notebook


def joined(outputs: list[NotebookNode]) -> list[NotebookNode]:
    """Return outputs with the pieces of a text, which come as they are flushed, in one."""
    whole: list[NotebookNode] = []
    for output in outputs:
        if whole and output.output_type == "stream" and whole[-1].get("name") == output.name:
            whole[-1].text += output.text
        else:
            whole.append(output)
    return whole


def few_colours(picture: str) -> str:
    """Return a PNG picture, in base 64, at most 900 pixels wide and with 96 colours."""
    image = Image.open(io.BytesIO(base64.b64decode(picture))).convert("RGB")
    image.thumbnail((900, 3600))
    packed = io.BytesIO()
    image.quantize(96, dither=Image.Dither.NONE).save(packed, "png", optimize=True)
    return base64.b64encode(packed.getvalue()).decode("ascii") + "\n"


def fragment(frame: str) -> str:
    """Return the viewer inside a frame, without the page around it."""
    page = html.unescape(re.search(r'srcdoc="(.*?)"', frame, re.DOTALL)[1])
    viewer = re.search(r'<div class="viewer".*?</script>\n</div>', page, re.DOTALL)[0]
    return re.sub(r'data:image/png;base64,([^"]+)', lambda still: smaller_still(still[1]), viewer)


def smaller_still(picture: str) -> str:
    """Return the address of a PNG picture, in base 64, as WebP: shades and what is clear stay."""
    image = Image.open(io.BytesIO(base64.b64decode(picture)))
    packed = io.BytesIO()
    image.save(packed, "webp", quality=80, method=6)
    return f"data:image/webp;base64,{base64.b64encode(packed.getvalue()).decode('ascii')}"


def main(arguments: list[Any]) -> None:
    """Store the outputs of the notebooks with these numbers, or of all."""
    for path in sorted(FOLDER.glob("*.ipynb")):
        if arguments and path.stem.split("_")[0] not in arguments:
            continue
        nbformat.write(small(executed(path)), path)
        print(f"{path.name}: {path.stat().st_size / 2**10:.0f} KiB", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
