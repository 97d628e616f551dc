"""`pyramap compare`: two maps, voxel by voxel."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from .. import pictures
from .comparing import STATES, compare_maps, comparison_facts
from .facts import Facts
from .failures import DIFFERENT
from .maps import open_map
from .options import MAP_HELP, AsJson
from .outputs import check_writable, picture_path, write_picture
from .products import file_sizes, slice_facts
from .slice import middle
from .summary import Row, print_files, print_json, print_table
from .terminal import working_on
from .values import Axis


def compare_files(
    first: Annotated[Path, typer.Argument(metavar="A", help=MAP_HELP)],
    second: Annotated[Path, typer.Argument(metavar="B", help="Another, of the same resolution.")],
    tolerance: Annotated[
        float, typer.Option(min=0, help="By how much the log-odds of a voxel may differ; unknown counts as 0.")
    ] = 0.0,
    png: Annotated[
        Path | None, typer.Option(callback=picture_path, help="Draw the differences on a plane, into a .png.")
    ] = None,
    axis: Annotated[Axis, typer.Option(help="Axis that the plane of --png is perpendicular to.")] = Axis.z,
    at: Annotated[
        float | None, typer.Option(help="Where it cuts the axis, metres; by default at the voxel that differs most.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Compare the maps A and B voxel by voxel: states, log-odds, volumes.

    The exit code is 0 if they are the same, within --tolerance, and 3 if they differ.
    """
    check_writable([png])
    one, other = open_map(first, backend="cpu"), open_map(second, backend="cpu")
    with working_on("comparing"):
        comparison = compare_maps(one, other, tolerance)
    facts = comparison_facts(comparison, one, other)
    if png is not None:
        index = pictures.AXES.index(axis.value)
        worst = comparison.worst
        if at is None:
            # Maps that are the same differ nowhere: their middle is as good as any place.
            at = (worst.voxel[index] + 0.5) * one.voxel_size if worst else middle(one, first)[index]
        with working_on("drawing the slice"):
            drawn = pictures.cut_difference(one, other, pictures.layer_plane(one.voxel_size, index, at))
            write_picture(png, pictures.difference_image(drawn))
        facts["slice"] = slice_facts(drawn)
    facts["files"] = file_sizes([png] if png else [])
    if as_json:
        print_json(facts)
    else:
        print_table(f"{first} and {second}", _rows(facts, tolerance))
        print_files(facts)
    if comparison.differing:
        raise typer.Exit(DIFFERENT)


def _rows(facts: Facts, tolerance: float) -> Iterator[Row]:
    for name, (a, b) in facts["parameters"].items():
        yield name, f"{a} and {b}"
    blocks = facts["blocks"]
    yield "blocks", f"{blocks['both']:,} in both, {blocks['first']:,} only in A, {blocks['second']:,} only in B"
    yield "known voxels", f"{facts['known']:,} in either"
    known_to_both = sum(facts["states"][f"{a} -> {b}"] for a in STATES[1:] for b in STATES[1:])
    yield "  in both", f"{known_to_both:,}"
    for name, voxels in facts["states"].items():
        before, _, after = name.partition(" -> ")
        if voxels and before != after:
            yield f"  {name}", f"{voxels:,}"
    for name, (a, b) in facts["volumes"].items():
        yield f"{name} volume", f"{a:,.3f} m³ and {b:,.3f} m³"
    if facts["worst"] is None:
        yield "log-odds", "the same in every voxel: the maps are equal"
        return
    beyond = f"{facts['differing']:,} voxels differ" + (f" by more than {tolerance:g}" if tolerance else "")
    yield "log-odds", f"{beyond}; mean difference {facts['mean_difference']:.3g}"
    for threshold, voxels in facts["exceeding"].items():
        if voxels and float(threshold) > 0:
            yield f"  by more than {threshold}", f"{voxels:,} voxels"
    worst = facts["worst"]
    centre = ", ".join(f"{x:.3f}" for x in worst["centre"])
    a, b = worst["log_odds"]
    yield "  most", f"{worst['difference']:.4g}: {a:.4g} and {b:.4g} at ({centre}) m"
    if "slice" in facts:
        yield "slice", facts["slice"]["plane"]
