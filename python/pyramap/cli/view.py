"""`pyramap view`: a map in the viewer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import datasets
from .facts import Facts
from .maps import open_map
from .options import DATASET_HELP, AsJson, MapFile, MinEvidence, Up
from .outputs import check_writable, recording_path
from .products import file_sizes, mesh_facts, which_way_up
from .summary import print_files, print_json, print_table, view_rows
from .terminal import frame_progress, working_on
from .watching import recorders


def view_map(
    file: MapFile,
    dataset: Annotated[
        Path | None,
        typer.Argument(
            metavar="DATASET",
            help=f"Show the way and the images of these frames too. {DATASET_HELP}",
            show_default=False,
        ),
    ] = None,
    save: Annotated[
        Path | None,
        typer.Option(callback=recording_path, help="Write a recording, an .rrd file, instead of opening the viewer."),
    ] = None,
    up: Up = None,
    min_evidence: MinEvidence = 0.0,
    stride: Annotated[int, typer.Option(min=1, help="Take every n-th frame of DATASET.")] = 1,
    limit: Annotated[int | None, typer.Option(min=1, help="Take at most n frames of DATASET.")] = None,
    skip_bad: Annotated[bool, typer.Option("--skip-bad", help="Leave out bad frames instead of stopping.")] = False,
    as_json: AsJson = False,
) -> None:
    """Show MAP in Rerun's viewer: its surface, and its occupied voxels coloured by height.

    With DATASET, the way of the camera and the images too, on a time line. The viewer is the extra `viz`.
    """
    check_writable([save])
    grid = open_map(file, backend="cpu")
    frames = None if dataset is None else datasets.open(dataset, stride=stride, limit=limit, skip_bad=skip_bad)
    with working_on("making the mesh"):
        mesh = grid.mesh(min_evidence=min_evidence)
    with recorders(live=save is None, save=save, frames=frames is not None) as (recorder,):
        recorder.set_up(which_way_up(mesh, up))
        boxes = recorder.show_map(grid, mesh)
        shown = 0
        if frames is not None:
            with frame_progress() as progress:
                for frame in progress.track(frames, total=len(frames), description="showing"):
                    recorder.show_frame(frame)
                    shown += 1
    facts: Facts = {
        "boxes": len(boxes.centres),
        "box_edge": boxes.edge,
        "mesh": mesh_facts(mesh),
        "frames": shown,
        "left_out": {} if frames is None else {str(index): reason for index, reason in frames.skipped.items()},
        "files": file_sizes([save] if save else []),
    }
    if as_json:
        print_json(facts)
    else:
        print_table(str(file), view_rows(facts))
        print_files(facts)
