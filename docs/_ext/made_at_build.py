"""Makes all pictures before the pages are read, with the code of this tree, into `generated/`.

Four kinds: what the blocks of pages make that are followed (`follow.py`), the figures of `figures/`, what the examples
make, with a page for each, and the shell's own help. What was made with the very same sources stays as it is.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import gallery
import pyramap
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util import logging

HERE = Path(__file__).parent
DOCS = HERE.parent
GENERATED = DOCS / "generated"
FOLLOWED = [DOCS / "first_map.md", DOCS / "howto/look_at_a_map.md"]
"""Pages whose blocks make the pictures that they show; one after the other, in one folder."""
logger = logging.getLogger(__name__)


def make_all(app: Sphinx) -> None:
    """Makes what is missing or was made with other sources."""
    follow = HERE / "follow.py"
    make(GENERATED / "followed", [follow, *FOLLOWED], [follow, GENERATED / "followed", *FOLLOWED])
    for script in sorted((DOCS / "figures").glob("[!_]*.py")):
        folder = GENERATED / "figures" / script.stem
        make(folder, [script, script.with_name("_style.py")], [script, folder / f"{script.stem}.png"])
    pages = GENERATED / "examples"
    scripts = gallery.scripts()
    for script in scripts:
        folder = pages / script.stem
        command = [script, *gallery.arguments(script), "--folder", folder]
        printed = make(folder, [script, HERE / "gallery.py"], command)
        if printed is not None:
            (pages / f"{script.stem}.md").write_text(gallery.page(script, printed, folder))
    (pages / "index.md").write_text(gallery.index(scripts, pages))
    shell = ["-m", "typer", "pyramap.cli", "utils", "docs", "--name", "pyramap", "--title", "The shell"]
    (GENERATED / "shell.md").write_text(run(shell))


@cache
def digest_of_package() -> str:
    """Of all that the package is made of: times say nothing, since a build may write the same bytes again."""
    files = sorted(file for file in Path(pyramap.__file__).parent.rglob("*") if file.suffix in (".py", ".so", ".pyd"))
    return digest(files)


def digest(files: list[Path]) -> str:
    """One number for the contents of files."""
    return hashlib.sha256(b"".join(hashlib.sha256(file.read_bytes()).digest() for file in files)).hexdigest()


def make(folder: Path, sources: list[Path], command: Sequence[object]) -> str | None:
    """Runs a Python script that makes what belongs into a folder, unless that was made with the same sources.

    Returns what it printed, or None.
    """
    wanted = digest(sources) + digest_of_package()
    stamp = folder / ".made_with"
    if stamp.exists() and stamp.read_text() == wanted:
        return None
    logger.info("making %s", folder.relative_to(DOCS))
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    printed = run(command)
    stamp.write_text(wanted)
    return printed


def run(command: Sequence[object]) -> str:
    """Runs a Python script; gives what it printed."""
    environment = {**os.environ, "MPLBACKEND": "agg"}
    result = subprocess.run(
        [sys.executable, *map(str, command)], env=environment, capture_output=True, text=True, check=False
    )
    if result.returncode != 0:
        raise ExtensionError(f"{' '.join(map(str, command))} failed:\n{result.stdout}{result.stderr}")
    return result.stdout


def setup(app: Sphinx) -> dict[str, bool]:
    """Sphinx calls this."""
    app.connect("builder-inited", make_all)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
