"""All experiments in their order, and the folder that they are written to."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from .. import __version__, num_threads
from . import charts, figure1, figure2, figure3, figure4, figure5, figure6, figure7, table1, volumes, walk
from .effort import FULL, Effort
from .page import write_page
from .section import Section

PAGE, RESULTS = "index.html", "results.json"

Announce = Callable[[str], AbstractContextManager[None]]
"""Entered while something of that name is worked on."""


@dataclass(frozen=True)
class Reproduction:
    """What came of it.

    Attributes:
        results: All numbers, as in `results.json`.
        paths: The files written, the page first.
    """

    results: dict[str, Any]
    paths: list[Path]


def reproduce(folder: Path, effort: Effort, backend: walk.Backend, announce: Announce) -> Reproduction:
    """Do every experiment, and write the page, its pictures and the results.

    Args:
        folder: Where to; must exist.
        effort: How much of each.
        backend: On which the office is mapped.
        announce: Told of each experiment.
    """
    sections, pictures = [], {}
    for section in _sections(effort, backend, announce):
        sections.append(section)
        for name, figure in section.figures.items():
            pictures[name] = charts.png(figure)
            (folder / f"{name}.png").write_bytes(pictures[name])
    results: dict[str, Any] = {
        "pyramap": __version__,
        "quick": effort != FULL,
        "effort": asdict(effort),
        "machine": {"processor": platform.machine(), "cpus": os.cpu_count(), "threads": num_threads()},
        **{section.name: section.results for section in sections},
    }
    (folder / RESULTS).write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    quick = None if effort == FULL else _left_out(effort)
    colophon = f"pyramap {__version__}, {platform.machine()}, {num_threads()} threads of {os.cpu_count()} processors."
    (folder / PAGE).write_text(write_page(sections, pictures, quick, colophon), encoding="utf-8")
    return Reproduction(results, [folder / PAGE, folder / RESULTS, *(folder / f"{name}.png" for name in pictures)])


def _left_out(effort: Effort) -> dict[str, str]:
    return {
        "rooms": _ordinal(effort.room_stride),
        "office": _ordinal(effort.office_stride),
        "views": str(effort.views),
    }


def _ordinal(number: int) -> str:
    return f"{number}th" if number > 3 else ("", "single", "second", "third")[number]


def _sections(effort: Effort, backend: walk.Backend, announce: Announce) -> Iterator[Section]:
    with announce("Figure 1"):
        curves = figure1.compute()
        lead_sigmas = curves.lead / figure1.SIGMA
        yield figure1.section(curves)
    with announce("Figure 2"):
        yield figure2.section(figure2.compute())
    with announce("Figure 3"):
        yield figure3.section(figure3.compute())
    with announce("Figure 4: mapping BOX and SPHERES"):
        yield figure4.section(figure4.compute(effort), lead_sigmas)
    with announce("Figure 5"):
        yield figure5.section(figure5.compute())
    with announce("Figure 6"):
        yield figure6.section(figure6.compute())
    with announce("Figure 7 and Table 1: mapping the office"):
        walked = walk.compute(effort, backend)
        yield figure7.section(figure7.compute(walked, effort), lead_sigmas)
        yield table1.section(table1.compute(walked), walked)
    with announce("comparing all rules with the ideal"):
        yield volumes.section(volumes.compute(effort))
