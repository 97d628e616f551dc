"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .._core import set_num_threads
from .outputs import mesh_path, picture_path
from .values import Backend, Numbers, direction


def _use_threads(count: int | None) -> int | None:
    if count is not None:
        set_num_threads(count)
    return count


DATASET_HELP = (
    "Folder or file with depth images and poses: 7-Scenes, TUM RGB-D, Redwood or ICL-NUIM, ScanNet, Replica, "
    "nerfstudio, Stray Scanner, Record3D (.r3d), or a ROS bag (.bag, .mcap, .db3, or a ROS 2 bag's folder)."
)
MAP_HELP = "A map: a .pmap file, or a .bt or .ot file of OctoMap."
MapFile = Annotated[Path, typer.Argument(metavar="MAP", help=MAP_HELP)]
MeshOut = Annotated[
    Path | None, typer.Option("--mesh", callback=mesh_path, help="Write the mesh: .ply, .obj, .stl or .glb.")
]
PictureOut = Annotated[
    Path | None, typer.Option("--png", callback=picture_path, help="Draw the mesh from obliquely above, into a .png.")
]
Threads = Annotated[
    int | None, typer.Option(min=1, callback=_use_threads, help="How many threads compute; all cores by default.")
]
BackendChoice = Annotated[Backend, typer.Option(help="What computes; auto is a GPU if there is one, else the CPU.")]
AdapterChoice = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="Compute on the GPU with this in its name; `pyramap info --devices` lists them.",
        show_default=False,
    ),
]
MinEvidence = Annotated[
    float,
    typer.Option(min=0.0, help="The mesh passes by voxels with less evidence (log-odds, either sign) than this."),
]
Up = Annotated[
    Numbers | None,
    typer.Option(
        parser=direction,
        metavar="X,Y,Z",
        help="Which way is up, such as z or 0,0.1,1; by default where most surface faces.",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout instead of a table.")]
