"""The shell: `pyramap demo | map | info | mesh | slice | view | report | compare | bench | paper`, one module each.

Exit codes: 0 done, 1 failed (the message on stderr says why), 2 wrongly called, 3 the maps compared
differ, 130 interrupted.
"""

from __future__ import annotations

import logging
from typing import Annotated

import typer

from .. import __version__
from .bench import bench
from .compare import compare_files
from .demo import run_demo
from .failures import ExplainingGroup
from .info import describe_map
from .map import map_dataset
from .mesh import mesh_map
from .paper import repeat_paper
from .report import report_map
from .slice import slice_map
from .view import view_map

app = typer.Typer(
    cls=ExplainingGroup,
    help="Probabilistic 3D occupancy maps from depth images.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"pyramap {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    # On its first use Matplotlib tells of its font cache, on stderr.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)


app.command("demo")(run_demo)
app.command("map")(map_dataset)
app.command("info")(describe_map)
app.command("mesh")(mesh_map)
app.command("slice")(slice_map)
app.command("view")(view_map)
app.command("report")(report_map)
app.command("compare")(compare_files)
app.command("bench")(bench)
app.command("paper")(repeat_paper)


def main() -> None:
    """Entry point of the command `pyramap`."""
    app()
