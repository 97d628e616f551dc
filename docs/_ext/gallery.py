"""The pages of the examples: what each says of itself, what it prints and draws, and its source."""

from __future__ import annotations

import ast
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples"
QUICK = {"area_sampling": ["--quick"], "explore": ["--views", "40"], "spheres_accuracy": ["--quick"]}
"""Arguments for those that take longer than a few seconds."""


def scripts() -> list[Path]:
    """All examples, by name."""
    return sorted(EXAMPLES.glob("*.py"))


def arguments(script: Path) -> list[str]:
    """With which a script is run for its page."""
    return QUICK.get(script.stem, [])


def title(script: Path) -> str:
    """The name as words."""
    return script.stem.replace("_", " ").capitalize()


def docstring(script: Path) -> str:
    """What a script says of itself."""
    text = ast.get_docstring(ast.parse(script.read_text()))
    if text is None:
        raise ValueError(f"{script} has no docstring")
    return text


def pictures(folder: Path) -> list[str]:
    """Names of the pictures in a folder, in the order in which they were drawn."""
    return [file.name for file in sorted(folder.glob("*.png"), key=lambda file: file.stat().st_mtime_ns)]


def page(script: Path, printed: str, folder: Path) -> str:
    """The page of an example that has been run into a folder beside the page."""
    command = " ".join(["python", f"examples/{script.name}", *arguments(script), "--folder", "."])
    shown = "\n\n".join(f"![What {script.name} draws]({folder.name}/{name})" for name in pictures(folder))
    if not shown:
        raise ValueError(f"{script} has drawn nothing")
    said = printed.replace(str(folder), ".").strip("\n")
    return f"""# {title(script)}

{docstring(script)}

{shown}

This is what it printed and drew when this page was made, with

```console
$ {command}
```

```text
{said}
```

## Source

```{{literalinclude}} ../../../examples/{script.name}
:language: python
```
"""


def index(scripts: list[Path], pages: Path) -> str:
    """The page that leads to all of them, which lie in a folder."""
    entries = "\n".join(entry(script, pages / script.stem) for script in scripts)
    names = "\n".join(script.stem for script in scripts)
    return f"""# Examples

Short scripts, each a whole program. Every build of these pages runs them, and so do the tests.

{entries}
```{{toctree}}
:hidden:

{names}
```
"""


def entry(script: Path, folder: Path) -> str:
    """An example's part of that page: its first words, and what it drew last."""
    first_words = docstring(script).split("\n\n")[0]
    picture = f"{folder.name}/{pictures(folder)[-1]}"
    return f"""## [{title(script)}]({script.stem}.md)

{first_words}

```{{image}} {picture}
:alt: {title(script)}
:target: {script.stem}.html
:width: 60%
```
"""
