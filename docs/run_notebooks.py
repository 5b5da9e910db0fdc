"""Run the notebooks and store them with what they show; or tell which of them show what their cells no longer say.

python docs/run_notebooks.py            # all whose cells, or whose version of hmc, are not those they were run with
python docs/run_notebooks.py 03 07      # these
python docs/run_notebooks.py --check    # runs nothing; ends with 1 where one is stale
"""

import argparse
import base64
import hashlib
import io
import os
import re
import sys
import tempfile
from pathlib import Path

import nbformat
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "notebooks"
#: A stored notebook is no larger than this, bytes.
MOST_BYTES = 1_500_000


def version() -> str:
    """The version of the package in this checkout, without importing it."""
    found = re.search(r'^__version__ = "(.+)"', (ROOT / "hmc" / "__init__.py").read_text(encoding="utf-8"), re.MULTILINE)
    if found is None:
        sys.exit("hmc/__init__.py: there is no __version__")
    return found[1]


def digest(notebook: nbformat.NotebookNode) -> str:
    """What tells the cells of code of a notebook, and the package's version, from others: 16 hexadecimal digits."""
    cells = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    return hashlib.sha256("\0".join([version(), *cells]).encode()).hexdigest()[:16]


def is_stale(notebook: nbformat.NotebookNode) -> bool:
    """Whether what a notebook shows was made by other cells, or by another version of the package."""
    return notebook.metadata.get("hmc", {}).get("cells") != digest(notebook)


def run(path: Path) -> nbformat.NotebookNode:
    """A notebook, run in its folder."""
    import jupyter_client
    import nbclient

    notebook = nbformat.read(path, as_version=4)
    # its kernel is to have this checkout, and pictures that do not depend on a user's settings
    os.environ |= {"PYTHONPATH": str(ROOT), "MPLBACKEND": "module://matplotlib_inline.backend_inline", "OPENBLAS_NUM_THREADS": "1"}
    with tempfile.TemporaryDirectory() as folder:
        kernel = jupyter_client.AsyncKernelManager(kernel_name="python3", transport="ipc", ip=str(Path(folder) / "kernel"))
        nbclient.NotebookClient(notebook, km=kernel, timeout=3600, resources={"metadata": {"path": str(path.parent)}}).execute()
    return notebook


def smaller(png: str) -> str:
    """A picture in base64 with 256 colors, where that takes fewer bytes: what is drawn looks the same, images of cameras nearly so."""
    before = base64.b64decode(png)
    picture = Image.open(io.BytesIO(before)).convert("RGBA")
    white = Image.new("RGBA", picture.size, "white")
    after = io.BytesIO()
    Image.alpha_composite(white, picture).convert("RGB").quantize(256, dither=Image.Dither.NONE).save(after, "PNG", optimize=True)
    return base64.b64encode(min(before, after.getvalue(), key=len)).decode()


def tidied(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """The notebook without what differs from run to run and machine to machine, and with the digest of its cells."""
    for cell in notebook.cells:
        cell.metadata = nbformat.NotebookNode()
        if cell.cell_type != "code":
            continue
        cell.execution_count = None
        kept = []
        for output in cell.outputs:
            if output.output_type == "stream" and output.name == "stderr":
                continue  # progress bars
            if "text" in output:
                output.text = re.sub(r"[^\s'\"]*/tmp\w{8}/", "", output.text)  # where a temporary folder was
            if "image/png" in output.get("data", {}):
                output.data = nbformat.NotebookNode({"image/png": smaller(output.data["image/png"])})
                output.metadata = nbformat.NotebookNode()
            if output.output_type == "execute_result":
                output.execution_count = None
            kept.append(output)
        cell.outputs = kept
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    notebook.metadata = nbformat.from_dict({"kernelspec": kernel, "language_info": {"name": "python"}, "hmc": {"cells": digest(notebook)}})
    return notebook


def main() -> int:
    """Run what is asked for, or what is stale."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NN", help="how the names of the notebooks begin (default: those that are stale)")
    parser.add_argument("--check", action="store_true", help="run nothing; tell which are stale")
    args = parser.parse_args()
    paths = sorted(path for path in FOLDER.glob("*.ipynb") if not args.names or path.name.startswith(tuple(args.names)))
    stale = [path for path in paths if args.names or is_stale(nbformat.read(path, as_version=4))]
    if args.check:
        for path in stale:
            print(f"{path.relative_to(ROOT)}: shows what its cells no longer say; run `make notebooks`")
        return 1 if stale else 0
    for path in stale:
        notebook = tidied(run(path))
        nbformat.validate(notebook)
        text = nbformat.writes(notebook)
        if len(text.encode()) > MOST_BYTES:
            sys.exit(f"{path.name}: {len(text.encode())} bytes with what it shows; make its pictures smaller")
        partial = path.with_suffix(".partial")
        partial.write_text(text + "\n", encoding="utf-8")
        partial.replace(path)
        print(f"{path.relative_to(ROOT)}: {len(text) // 1000} kB", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
