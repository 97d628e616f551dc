"""Mapping a camera while it runs: frames that come while the map is busy are dropped, and counted.

The camera is simulated: it looks around in a room of boxes, and gives a frame whenever one is due, whether somebody
takes it or not. Another camera comes in the same way: `pyramap.datasets.Live` takes any Python iterator.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import perf_counter, sleep

import numpy as np
import pyramap as pm
from matplotlib.figure import Figure
from numpy.typing import NDArray
from pyramap.datasets import Frame, Live


def main() -> None:
    parser = argparse.ArgumentParser(description="Map a simulated camera at its frame rate.")
    parser.add_argument("--frames", type=int, default=90, help="how many frames the camera takes")
    parser.add_argument("--rate", type=float, default=30.0, help="how many of them a second")
    parser.add_argument("--capacity", type=int, default=1, help="how many frames may wait to be mapped")
    parser.add_argument("--drop", choices=("oldest", "newest"), default="oldest", help="which then to drop")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()), help="where the picture goes")
    arguments = parser.parse_args()

    grid = pm.OccupancyGrid(voxel_size=0.05)
    views = list(pm.scenes.box().frames(noise=1)[: arguments.frames])  # rendered before, so that the camera is in time
    times, delays = [], []
    with Live(camera(views, arguments.rate), capacity=arguments.capacity, drop=arguments.drop) as stream:
        for due, frame in stream:
            grid.integrate(frame.depth, frame.camera, frame.world_from_camera)
            times.append(due)
            delays.append(perf_counter() - due)

    which = {"oldest": "the one that had waited longest", "newest": "the one that had just come"}[arguments.drop]
    print(f"{stream.received} frames at {arguments.rate:g} a second, of which {arguments.capacity} may wait")
    print(f"{grid.num_frames} mapped, {stream.dropped} dropped: each time {which}")
    milliseconds = 1e3 * np.array(delays)
    print(f"from the camera into the map: {np.median(milliseconds):.0f} ms, at most {milliseconds.max():.0f} ms")
    print(f"{grid.num_observed} voxels seen, {grid.nbytes / 1e6:.1f} MB")
    picture = arguments.folder / "live_mapping.png"
    draw(np.array(times) - times[0], milliseconds).savefig(picture)
    print(f"drawn in {picture}")


def draw(times: NDArray[np.float64], milliseconds: NDArray[np.float64]) -> Figure:
    """How long each frame took from the camera into the map; a gap along the time is a frame that was dropped."""
    figure = Figure(figsize=(8, 3), layout="constrained")
    axes = figure.subplots()
    axes.vlines(times, 0, milliseconds, color="#0072b2")
    axes.plot(times, milliseconds, "o", markersize=3, color="#0072b2")
    axes.set(xlabel="when the camera took the frame (s)", ylabel="from the camera\ninto the map (ms)", ylim=(0, None))
    return figure


def camera(views: Sequence[Frame], rate: float) -> Iterator[tuple[float, Frame]]:
    """Gives each view when it is due, with that time; it does not wait for anybody."""
    start = perf_counter()
    for i, view in enumerate(views):
        due = start + i / rate
        sleep(max(0.0, due - perf_counter()))
        yield due, view


if __name__ == "__main__":
    main()
