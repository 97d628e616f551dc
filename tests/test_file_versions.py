"""Files that earlier versions of the program wrote: what they hold is calculated here from Eq. 7 alone.

`data/v1.pmap` and `data/v1_clamped.pmap` were written by the first program, whose format was version 1. Both hold two
equal frames of an image in which every pixel is 1.5 m from the camera. All texels of all layers are equal then, and
whatever the update rule does with them, a voxel's evidence is twice the model's log-odd at its distance.
"""

from __future__ import annotations

import math
import struct
from pathlib import Path

import numpy as np
import pyramap as pm
import pytest
from frames import map_bytes
from numpy.typing import NDArray

DATA = Path(__file__).parent / "data"
CLAMPS = {"v1": None, "v1_clamped": (-2.0, 3.0)}
CAMERA = pm.PinholeCamera(width=24, height=18, fx=16.0, fy=16.0, cx=11.5, cy=8.5)
POSITION = np.array([0.03, -0.02, 0.01])
VOXEL_SIZE, RANGE, MAX_RANGE, PRIOR = 0.125, 1.5, 2.0, 0.4
SIGMA, K, OFFSET = (0.1, 0.02, 0.0), 0.08, 0.05
STEP = 2.0**-12
"""Of stored log-odds."""


def evidence_of_two_frames(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) evidence at points in the camera's frame, 0 where the frames see nothing."""
    distance = np.linalg.norm(points, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = CAMERA.fx * points[:, 0] / points[:, 2] + CAMERA.cx
        v = CAMERA.fy * points[:, 1] / points[:, 2] + CAMERA.cy
    in_image = (u >= -0.5) & (u < CAMERA.width - 0.5) & (v >= -0.5) & (v < CAMERA.height - 0.5)
    seen = in_image & (points[:, 2] > 0) & (distance <= MAX_RANGE)
    a = (K / SIGMA[0]) / math.sqrt(2 * math.pi)
    sigma = SIGMA[0] + SIGMA[1] * RANGE
    g = np.exp(-(((distance - (RANGE + OFFSET)) / sigma) ** 2) / 2)
    p = np.where(distance <= RANGE + OFFSET, 0.3 + (a + 0.2) * g, 0.5 + a * g)
    return np.where(seen, 2 * np.log(p / (1 - p)), 0.0)


@pytest.mark.parametrize("name", CLAMPS)
def test_a_file_of_version_1_is_read(name: str) -> None:
    path = DATA / f"{name}.pmap"
    assert struct.unpack_from("<8sI", path.read_bytes()) == (b"PYRAMAP\0", 1)
    grid = pm.OccupancyGrid.load(path)
    assert (grid.voxel_size, grid.max_range, grid.max_bytes, grid.prior) == (VOXEL_SIZE, MAX_RANGE, 9_000_000, PRIOR)
    assert (grid.update, grid.beyond_max_range, grid.clamp) == ("pyramid", "ignore", CLAMPS[name])
    assert grid.sensor_model == pm.SensorModel(SIGMA, k=K, surface_offset=OFFSET)
    assert (grid.num_frames, grid.saturated) == (2, 0)
    assert (grid.num_decays, grid.decay_product, grid.num_erasures) == (0, 1.0, 0)

    blocks = grid.block_coords().astype(np.int64)
    within = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), axis=-1)
    voxels = (8 * blocks[:, None, None, None, :] + within).reshape(-1, 3)
    expected = evidence_of_two_frames((voxels + 0.5) * VOXEL_SIZE - POSITION)
    log_odds = grid.block_log_odds(blocks).ravel()
    prior = math.log(PRIOR / (1 - PRIOR))
    if (clamp := CLAMPS[name]) is not None:
        expected = np.clip(expected, clamp[0] - prior, clamp[1] - prior)
    # Behind the surface the model comes to nothing within a step of zero, which is not stored.
    np.testing.assert_array_equal(log_odds[np.abs(expected) > 2 * STEP] != 0, True)
    assert np.count_nonzero(log_odds) == grid.num_observed == 1644
    # Each frame was rounded to a step by way of a table that is exact to half a one, and the prior is added in float32.
    assert np.abs(np.where(log_odds == 0, 0, log_odds - prior) - expected).max() < 2 * STEP


def test_a_map_of_version_1_goes_on(tmp_path: Path) -> None:
    """Its frames can be taken off, and it is written in today's version."""
    grid = pm.OccupancyGrid.load(DATA / "v1.pmap")
    assert struct.unpack_from("<I", map_bytes(grid, tmp_path), 8) == (2,)
    again = pm.OccupancyGrid.load(tmp_path / "bytes.pmap")
    np.testing.assert_array_equal(again.block_coords(), grid.block_coords())
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    depth = RANGE / np.sqrt(((u - CAMERA.cx) / CAMERA.fx) ** 2 + ((v - CAMERA.cy) / CAMERA.fy) ** 2 + 1)
    pose = np.eye(4)
    pose[:3, 3] = POSITION
    for _ in range(2):
        again.remove(depth, CAMERA, pose)
    assert (again.num_blocks, again.num_frames) == (0, 0)


def test_damage_to_a_file_of_version_1_is_noticed(tmp_path: Path) -> None:
    good = (DATA / "v1.pmap").read_bytes()
    path = tmp_path / "damaged.pmap"
    rng = np.random.default_rng(3)
    for position in {*range(12), *rng.integers(12, len(good), 100).tolist()}:
        path.write_bytes(good[:position] + bytes([good[position] ^ 1 << int(rng.integers(8))]) + good[position + 1 :])
        with pytest.raises(OSError, match=rf"^{path}: "):
            pm.OccupancyGrid.load(path)


def test_a_file_that_gives_the_wrong_version(tmp_path: Path) -> None:
    """The bytes of one version do not pass for another's."""
    path = tmp_path / "map.pmap"
    old = (DATA / "v1.pmap").read_bytes()
    new = map_bytes(pm.OccupancyGrid.load(DATA / "v1.pmap"), tmp_path)
    for file, version in ((old, 2), (new, 1)):
        path.write_bytes(file[:8] + struct.pack("<I", version) + file[12:])
        with pytest.raises(OSError, match="unreadable parameters"):
            pm.OccupancyGrid.load(path)
