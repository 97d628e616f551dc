"""Facts on stdout: a table for people, or one JSON object for machines."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator

import typer
from rich.console import Console
from rich.table import Table

from .facts import Facts

Row = tuple[str, str]


def print_json(facts: Facts) -> None:
    """One line that is one JSON object."""
    typer.echo(json.dumps(facts))


def print_table(title: str, rows: Iterable[Row]) -> None:
    """A table of names and texts."""
    table = Table(title=title, title_justify="left", title_style="bold", show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for row in rows:
        table.add_row(*row)
    Console().print(table)


def print_columns(header: Iterable[str], rows: Iterable[Iterable[str]]) -> None:
    """A table with a column for each of several things; the first column names the rows."""
    table = Table()
    for number, name in enumerate(header):
        table.add_column(name, no_wrap=number == 0, justify="right" if number else "left")
    for row in rows:
        table.add_row(*row)
    Console().print(table)


def map_rows(facts: Facts) -> Iterator[Row]:
    """Rows for `map_facts`."""
    yield "voxel size", f"{facts['voxel_size']:g} m"
    yield "update rule", facts["update"]
    sigma, offset = facts["sigma"], facts["surface_offset"]
    sigma = f"{sigma:g} m" if isinstance(sigma, float) else f"{sigma[0]:g} + {sigma[1]:g} z + {sigma[2]:g} z² m"
    offset = f"{offset:g} m" if isinstance(offset, float) else offset
    yield "sensor model", f"sigma {sigma}, k {facts['k']:g} m, surface offset {offset}"
    yield "range", f"up to {facts['max_range']:g} m, readings beyond it: {facts['beyond_max_range']}"
    if facts["prior"] != 0.5:
        yield "prior", f"{facts['prior']:g}"
    if facts["clamp"]:
        yield "clamped", "log-odds {:g} to {:g}".format(*facts["clamp"])
    if facts["colour"]:
        yield "colour", "of voxels near surfaces"
    yield "frames", f"{facts['frames']:,}"
    if facts["bounds"]:
        low, high = facts["bounds"]
        spans = (f"{axis} {a:.2f} to {b:.2f}" for axis, a, b in zip("xyz", low, high, strict=True))
        yield "bounds (m)", ", ".join(spans)
    yield "voxels", f"{facts['voxels_free']:,} free, {facts['voxels_occupied']:,} occupied"
    if facts["saturated"]:
        yield "saturated", f"{facts['saturated']:,} times: these voxels no longer hold all their evidence"
    if facts["decays"]:
        yield "decayed", f"{facts['decays']:,} times, by {facts['decay_product']:g} in all"
    if facts["erasures"]:
        yield "erased", f"{facts['erasures']:,} times, by clear or crop"
    yield (
        "map",
        f"{facts['blocks']:,} blocks, {_size(facts['bytes'])} in memory ({facts['adapter'] or facts['backend']})",
    )


def device_rows(facts: Facts) -> Iterator[Row]:
    """Rows for `device_facts`."""
    played = ": the processor plays a GPU, and is used only if it is named" if facts["kind"] == "software" else ""
    yield "kind", facts["kind"] + played
    yield "interface", f"{facts['api']}, {facts['driver']}"
    yield "largest buffer", _size(facts["max_buffer_bytes"])
    yield "largest binding", _size(facts["max_binding_bytes"])
    if facts["problem"]:
        yield "cannot be used", facts["problem"]


def run_rows(facts: Facts) -> Iterator[Row]:
    """Rows for `run_facts`."""
    ended = "interrupted by Ctrl-C" if facts["interrupted"] else "failed" if facts["failure"] else "all"
    yield "fused", f"{facts['frames']:,} frames ({ended}), {len(facts['left_out']):,} left out"
    if facts["coloured"]:
        yield "with colour", f"{facts['coloured']:,} frames"
    if facts["frames"]:
        yield "speed", f"{facts['frames_per_second']:.1f} frames/s for {facts['seconds']:.1f} s"
    for name, milliseconds in facts["median_ms"].items():
        yield f"  {name}", f"{milliseconds:.2f} ms a frame (median)"
    if facts["peak_memory_bytes"] is not None:
        yield "peak memory", _size(facts["peak_memory_bytes"])


def product_rows(facts: Facts) -> Iterator[Row]:
    """Rows for meshes and slices that were made."""
    if "mesh" in facts:
        yield "mesh", "{vertices:,} vertices, {triangles:,} triangles".format(**facts["mesh"])
    if "slice" in facts:
        yield "slice", facts["slice"]["plane"]


def view_rows(facts: Facts) -> Iterator[Row]:
    """Rows for what the viewer was given."""
    yield "voxels", f"{facts['boxes']:,} boxes of {facts['box_edge']:g} m"
    yield from product_rows(facts)
    if facts["frames"]:
        yield "frames", f"{facts['frames']:,} shown, {len(facts['left_out']):,} left out"


def print_files(facts: Facts) -> None:
    """A line for each file written: outside of tables, where no path is cut."""
    for path, size in facts["files"].items():
        typer.echo(f"wrote {path} ({_size(size)})")


def _size(count: int) -> str:
    return f"{count / 1e6:,.1f} MB" if count >= 1e5 else f"{count / 1e3:.1f} kB"
