"""The page: one HTML file with its pictures inside, which needs no other file and no network."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from string import Template

from .section import Section, Table


def write_page(
    sections: Sequence[Section], pictures: Mapping[str, bytes], quick: Mapping[str, str] | None, colophon: str
) -> str:
    """Put it together.

    Args:
        sections: In their order.
        pictures: PNG files by the names of the sections' figures.
        quick: What a quick version says of itself, the values of `texts/quick.html`; None for all.
        colophon: Said at the end; plain text.

    Returns:
        HTML.
    """
    return _text("page").substitute(
        quick="" if quick is None else _text("quick").substitute(quick),
        contents="\n".join(f'<li><a href="#{section.name}">{escape(section.title)}</a></li>' for section in sections),
        sections="\n".join(_section(section, pictures) for section in sections),
        colophon=escape(colophon),
    )


def _text(name: str) -> Template:
    return Template(files(__package__).joinpath("texts", f"{name}.html").read_text(encoding="utf-8"))


def _section(section: Section, pictures: Mapping[str, bytes]) -> str:
    images = {name: _image(pictures[name], section.title) for name in section.figures}
    values = {name: escape(value, quote=False) for name, value in section.values.items()}
    tables = {} if section.table is None else {"table": _table(section.table)}
    text = _text(section.name).substitute(values | images | tables)
    return f'<section id="{section.name}">\n<h2>{escape(section.title)}</h2>\n{text}</section>'


def _image(png: bytes, title: str) -> str:
    return f'<img alt="{escape(title)}" src="data:image/png;base64,{b64encode(png).decode()}">'


def _table(table: Table) -> str:
    head = "".join(f"<th>{escape(name)}</th>" for name in table.header)
    rows = "\n".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows)
    return f"<table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}\n</tbody>\n</table>"
