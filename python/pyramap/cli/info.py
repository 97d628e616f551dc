"""`pyramap info`: what a map file holds."""

from __future__ import annotations

from .._core import OccupancyGrid
from .facts import map_facts
from .options import AsJson, MapFile
from .products import file_sizes
from .summary import map_rows, print_json, print_table


def describe_map(file: MapFile, as_json: AsJson = False) -> None:
    """Say how MAP was made and what it holds."""
    facts = {"map": map_facts(OccupancyGrid.load(file)), "files": file_sizes([file])}
    if as_json:
        print_json(facts)
    else:
        print_table(str(file), map_rows(facts["map"]))
