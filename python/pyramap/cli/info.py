"""`pyramap info`: what a map file holds, or which GPUs there are."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .._core import devices
from .facts import device_facts, map_facts
from .maps import open_map
from .options import MAP_HELP, AsJson
from .products import file_sizes
from .summary import device_rows, map_rows, print_json, print_table


def describe_map(
    file: Annotated[Path | None, typer.Argument(metavar="MAP", help=MAP_HELP, show_default=False)] = None,
    list_devices: Annotated[bool, typer.Option("--devices", help="List the GPUs that maps can run on.")] = False,
    as_json: AsJson = False,
) -> None:
    """Say how MAP was made and what it holds, or which GPUs this machine has."""
    if (file is None) != list_devices:
        raise typer.BadParameter("name a map, or ask for --devices")
    if file is None:
        found = [device_facts(device) for device in devices()]
        if as_json:
            print_json({"devices": found})
        elif found:
            for facts in found:
                print_table(facts["name"], device_rows(facts))
        else:
            typer.echo("no graphics adapters: install the driver of your card; on Linux its Vulkan driver")
        return
    facts = {"map": map_facts(open_map(file, backend="cpu")), "files": file_sizes([file])}
    if as_json:
        print_json(facts)
    else:
        print_table(str(file), map_rows(facts["map"]))
