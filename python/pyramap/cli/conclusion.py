"""How a run ends: files written, the outcome told, the exit code given."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import typer

from .._core import OccupancyGrid
from .facts import map_facts, run_facts
from .failures import FAILED, INTERRUPTED
from .fusing import Run
from .products import Products, file_sizes, write_products
from .summary import map_rows, print_files, print_json, print_table, product_rows, run_rows


def conclude(
    name: str,
    grid: OccupancyGrid,
    run: Run,
    skipped: Mapping[int, str],
    products: Products,
    min_evidence: float,
    as_json: bool,
    recording: Path | None = None,
) -> None:
    """Write what was asked for, say how the run went, and exit with its code.

    A run that ended early keeps its map, if that was asked for, and makes nothing else: who pressed Ctrl-C waits.

    Args:
        name: What was mapped.
        grid: The map.
        run: How its frames were fused.
        skipped: Frames that were left out before the map saw them, by index, with the reason.
        products: The files asked for.
        min_evidence: As for `OccupancyGrid.mesh`.
        as_json: Print JSON instead of a table.
        recording: Of the run, already written, if one was asked for.

    Raises:
        ValueError: No frame was fused, though none failed.
        typer.Exit: The run ended early.
    """
    if run.frames == 0 and not run.interrupted and run.failure is None:
        reasons = [*skipped.values(), *run.rejected.values()]
        raise ValueError(
            f"{name}: no frame could be fused" + (f"; the first was left out: {reasons[0]}" if reasons else "")
        )
    if run.ended_early:
        products = Products(map=products.map if run.frames else None)
    made = write_products(grid, products, run.poses, min_evidence)
    if recording is not None:
        made["files"] |= file_sizes([recording])
    facts = {"name": name, "run": run_facts(run, skipped), "map": map_facts(grid), **made}
    if as_json:
        print_json(facts)
    else:
        print_table(name, [*run_rows(facts["run"]), *map_rows(facts["map"]), *product_rows(facts)])
        print_files(facts)
    if run.ended_early:
        files = ((f"the map of {run.frames} frames", products.map), ("the recording", recording))
        kept = ", ".join(f"{what} is in {path}" for what, path in files if path) or "nothing is kept"
        typer.echo(f"interrupted: {kept}" if run.interrupted else f"error: {run.failure}; {kept}", err=True)
        raise typer.Exit(INTERRUPTED if run.interrupted else FAILED)
