"""Does what pages of the documentation say: `python follow.py FOLDER PAGE...`.

Their blocks of shell (`sh`) and Python (`python`) are run in their order, in FOLDER. A block of `text` right after one
is what that one prints, and must be; `...` in it stands for anything. A block after a line `% not run: REASON` is left
out.
"""

from __future__ import annotations

import contextlib
import doctest
import io
import itertools
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

BLOCK = re.compile(r"^(?P<skip>% not run: [^\n]+\n)?```(?P<language>\w+)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)


@dataclass(frozen=True)
class Step:
    """One block, what it is to print if the page says so, and the lines of the page before it."""

    language: str
    code: str
    prints: str | None
    line: int


def steps_of(page: str) -> Iterator[Step]:
    """The blocks to be run."""
    blocks = list(BLOCK.finditer(page))
    for block, after in itertools.zip_longest(blocks, blocks[1:]):
        if block["language"] not in ("sh", "python") or block["skip"]:
            continue
        follows = after is not None and after["language"] == "text" and not page[block.end() : after.start()].strip()
        prints = after["text"] if after is not None and follows else None
        yield Step(block["language"], block["text"], prints, page[: block.start("text")].count("\n"))


def follow(page: Path, folder: Path) -> int:
    """Runs all blocks of a page in a folder; says how many. Ends with the error of the first that fails."""
    names: dict[str, Any] = {"__name__": "__main__"}
    steps = list(steps_of(page.read_text()))
    folder.mkdir(parents=True, exist_ok=True)
    with contextlib.chdir(folder):
        for step in steps:
            printed = run_shell(step) if step.language == "sh" else run_python(step, page, names)
            checker = doctest.OutputChecker()
            options = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
            if step.prints is not None and not checker.check_output(step.prints, printed, options):
                sys.exit(f"{page}:{step.line + 1}: the page says\n{step.prints}\nand what was printed is\n{printed}")
    return len(steps)


def run_shell(step: Step) -> str:
    """Runs commands as a user would who has activated the environment of this Python."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "COLUMNS": "100"}
    command = ["bash", "-euo", "pipefail", "-c", step.code]
    result = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    return result.stdout


def run_python(step: Step, page: Path, names: dict[str, Any]) -> str:
    """Runs code that goes on with the names of the blocks before; errors show the page's lines."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile("\n" * step.line + step.code, page, "exec"), names)
    return printed.getvalue()


if __name__ == "__main__":
    folder, *pages = (Path(argument).resolve() for argument in sys.argv[1:])
    for page in pages:
        print(f"{follow(page, folder)} blocks of {page.name} run")
