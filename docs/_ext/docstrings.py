"""What autodoc cannot know of a compiled module: the types in its signatures, which are in `_core.pyi`.

Docstrings are Markdown in small: fenced code becomes a code block of reStructuredText.
"""

from __future__ import annotations

import ast
import copy
from pathlib import Path
from typing import Any

import pyramap
from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

STUB = Path(pyramap.__file__).with_name("_core.pyi")
MODULES = {"pyramap", "_core", "scenes"}
Function = ast.FunctionDef


class Aliases(ast.NodeTransformer):
    """Puts what an alias of the stub stands for in its place."""

    def __init__(self, aliases: dict[str, ast.expr]) -> None:
        self._aliases = aliases

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """An alias may stand for others in turn."""
        if node.id not in self._aliases:
            return node
        meant: ast.expr = self.visit(copy.deepcopy(self._aliases[node.id]))
        return meant


def read_stub() -> dict[str, Function]:
    """Functions by name, methods by `Class.method`, and constructors by `Class`, with aliases written out."""
    tree = ast.parse(STUB.read_text())
    assigned = [node for node in tree.body if isinstance(node, ast.AnnAssign) and node.value is not None]
    aliases = {node.target.id: node.value for node in assigned if isinstance(node.target, ast.Name) and node.value}
    tree = Aliases(aliases).visit(tree)
    found = {}
    for node in tree.body:
        if isinstance(node, Function):
            found[node.name] = node
        elif isinstance(node, ast.ClassDef):
            for member in node.body:
                if isinstance(member, Function):
                    found[node.name if member.name == "__new__" else f"{node.name}.{member.name}"] = member
    return found


SIGNATURES = read_stub()


def signature_of(name: str) -> Function | None:
    """The stub's entry for a public name."""
    return SIGNATURES.get(".".join(part for part in name.split(".") if part not in MODULES))


def add_types(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, signature: str | None, returns: str | None
) -> tuple[str, str | None] | None:
    """A signature as the stub has it."""
    function = signature_of(name) if what in ("class", "method", "function") else None
    if function is None:
        return None
    arguments = function.args
    is_static = any(isinstance(node, ast.Name) and node.id == "staticmethod" for node in function.decorator_list)
    if ("." in name.removeprefix("pyramap.") and not is_static) or what == "class":
        arguments = copy.deepcopy(arguments)
        (arguments.posonlyargs or arguments.args).pop(0)
    result = None if what == "class" or function.returns is None else ast.unparse(function.returns)
    return f"({ast.unparse(arguments)})", result


def add_type_of_property(app: Sphinx, domain: str, kind: str, content: addnodes.desc_content) -> None:
    """A property's type behind its name."""
    signature: Any = content.parent[0] if content.parent else None
    if domain != "py" or kind not in ("property", "attribute") or "fullname" not in signature:
        return
    function = signature_of(signature["fullname"])
    if function is not None and function.returns is not None:
        signature += addnodes.desc_annotation("", "", nodes.Text(": " + ast.unparse(function.returns)))


def convert_fences(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Fenced code of Markdown as code blocks."""
    inside = False
    for i, line in enumerate(lines):
        stripped = line.strip()
        if stripped.startswith("```"):
            language = stripped.removeprefix("```")
            lines[i] = "" if inside else f".. code-block:: {language}\n"
            inside = not inside
        elif inside and line:
            lines[i] = "    " + line
    lines[:] = "\n".join(lines).split("\n")


class Properties:
    """Keeps napoleon off properties: it would take what stands before a colon in the first line for a type."""

    def __init__(self) -> None:
        self._lines: list[str] = []

    def keep(self, app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
        """Before napoleon."""
        self._lines = list(lines)

    def restore(self, app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
        """After it."""
        if what in ("attribute", "property"):
            lines[:] = self._lines


def setup(app: Sphinx) -> dict[str, bool]:
    """Sphinx calls this."""
    app.connect("autodoc-process-signature", add_types)
    properties = Properties()
    app.connect("autodoc-process-docstring", convert_fences, priority=300)
    app.connect("autodoc-process-docstring", properties.keep, priority=400)
    app.connect("autodoc-process-docstring", properties.restore, priority=600)  # napoleon has 500
    app.connect("object-description-transform", add_type_of_property)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
