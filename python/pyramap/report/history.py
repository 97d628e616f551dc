"""What a map says of how it came about, in sentences."""

from __future__ import annotations

from collections.abc import Iterator

from .._core import OccupancyGrid


def history(grid: OccupancyGrid) -> Iterator[str]:
    """What was done to a map, and what follows from it."""
    frames = grid.num_frames
    yield f"{frames:,} frame{'s were' if frames != 1 else ' was'} fused, with the update rule {grid.update!r}."
    losses = list(_losses(grid))
    yield from losses
    if losses:
        yield "So the evidence is no longer the sum of that of the frames, and no frame can be taken off exactly."
    else:
        yield (
            "Nothing was clamped, decayed, cleared or cropped, and no voxel overflowed: the evidence is the exact sum "
            "of that of the frames, in whatever order they came. Any frame can be taken off, and other maps added."
        )


def _losses(grid: OccupancyGrid) -> Iterator[str]:
    """What took evidence away."""
    if grid.clamp is not None:
        yield "Log-odds are clamped to {:g} to {:g}, which forgets evidence beyond that.".format(*grid.clamp)
    if grid.saturated:
        yield f"{grid.saturated:,} additions to voxels were too large to be stored whole."
    if grid.num_decays:
        yield f"The evidence was decayed {_times(grid.num_decays)}, to {grid.decay_product:.3g} of it in all."
    if grid.num_erasures:
        yield f"Parts were made unknown {_times(grid.num_erasures)}, by clearing or cropping."


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count:,} times"
