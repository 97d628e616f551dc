"""The role `src`: a place in the source, `crates/pyramap/src/sensor.rs::log_odds_at`, that must exist.

A file, or a file and a name that it defines: a function, type or constant in Rust, WGSL or Python. Where either is gone
there is a warning, and so the build fails: pages cannot point to code that is no longer there.
"""

from __future__ import annotations

import re
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.docutils import SphinxRole

ROOT = Path(__file__).parents[2]
DEFINED_BY = r"\b(?:fn|struct|enum|trait|type|const|mod|def|class)\s+{name}\b|^{name}\s*[:=]"
logger = logging.getLogger(__name__)


def problem_of(place: str, root: Path = ROOT) -> str | None:
    """What is wrong with a place in the source, or None."""
    file, _, name = place.partition("::")
    if not (root / file).is_file():
        return f"there is no file {file}"
    if name and not re.search(DEFINED_BY.format(name=re.escape(name)), (root / file).read_text(), re.MULTILINE):
        return f"{file} defines no {name}"
    return None


class SourceRole(SphinxRole):
    """Shows the file and, behind a colon, the name."""

    def run(self) -> tuple[list[nodes.Node], list[nodes.system_message]]:
        """The text as code, once it is known to be true."""
        problem = problem_of(self.text)
        if problem is not None:
            logger.warning(problem, location=self.get_location(), type="src")
        file, _, name = self.text.partition("::")
        return [nodes.literal(self.text, f"{file}: {name}" if name else file)], []


def setup(app: Sphinx) -> dict[str, bool]:
    """Sphinx calls this."""
    app.add_role("src", SourceRole())
    return {"parallel_read_safe": True, "parallel_write_safe": True}
