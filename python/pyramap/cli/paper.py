"""`pyramap paper`: every figure and table of the paper, made anew."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .options import AsJson, BackendChoice, Threads
from .outputs import check_writable
from .products import file_sizes
from .summary import print_files, print_json
from .terminal import working_on
from .values import Backend


def repeat_paper(
    output: Annotated[
        Path,
        typer.Option("--output", "-o", help="Folder for the page, its pictures and results.json; made if missing."),
    ] = Path("out/paper"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer images, for a first look: less than two minutes.")
    ] = False,
    backend: BackendChoice = Backend.auto,
    threads: Threads = None,
    as_json: AsJson = False,
) -> None:
    """Repeat every figure and table of the paper, and write a page about it.

    The page says of each what differs from the paper, and why. `--backend` is for the indoor loop, which is timed.
    """
    # Matplotlib takes half a second to load: only who draws waits for it.
    from .. import paper

    output.mkdir(parents=True, exist_ok=True)
    check_writable([output / name for name in (paper.PAGE, paper.RESULTS)])
    done = paper.reproduce(output, paper.QUICK if quick else paper.FULL, backend.value, working_on)
    facts = {"results": done.results, "files": file_sizes(done.paths)}
    if as_json:
        print_json(facts)
    else:
        print_files(facts)
