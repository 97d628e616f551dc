"""Files of OctoMap: the same voxels in both libraries, or an error that names the file."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pyramap as pm
import pytest
from frames import map_of, random_frames
from octomap_files import (
    Leaf,
    Octree,
    Tree,
    bt_file,
    centres,
    count,
    down,
    header,
    known,
    ot_file,
    read_nodes,
    read_octree,
    voxels,
    voxels_of_pyoctomap,
)
from real_data import real
from shell import json_of, png_bytes, run, write_office

UNIT = 2.0**-12
OCTOMAP_LIMITS = (math.log(0.1192 / 0.8808), math.log(0.971 / 0.029))
"""What OctoMap clamps to: probabilities 0.1192 and 0.971."""


@pytest.fixture(scope="module")
def grid() -> pm.OccupancyGrid:
    """A few blocks of each kind, on both sides of the origin."""
    return map_of(random_frames(2, seed=8), voxel_size=0.06)


def load(file: bytes, folder: Path, **options: Any) -> pm.OccupancyGrid:
    path = folder / "some.tree"
    path.write_bytes(file)
    return pm.load_octomap(path, **options)


def save(grid: pm.OccupancyGrid, path: Path) -> Octree:
    grid.save_octomap(path)
    octree = read_octree(path.read_bytes())
    assert octree.nodes == int(octree.header["size"])
    return octree


def nodes_of(file: bytes) -> bytes:
    """A file without its header."""
    return file.partition(b"\ndata\n")[2]


# ---- files of others ----


@pytest.mark.parametrize(
    ("name", "res", "nodes", "leaves", "free", "occupied"),
    [("map.bt", 0.1, 171_287, 138_477, 124_648, 13_829), ("fr_079.bt", 0.05, 1_829_134, 1_476_170, None, None)],
)
def test_known_maps(
    name: str, res: float, nodes: int, leaves: int, free: int | None, occupied: int | None, tmp_path: Path
) -> None:
    path = real("octomap_oracle") / name
    octree = read_octree(path.read_bytes())
    values = np.array([leaf.value for leaf in octree.leaves])
    assert (octree.nodes, len(octree.leaves)) == (nodes, leaves)
    if free is not None:
        assert [int((values < 0).sum()), int((values > 0).sum())] == [free, occupied]

    grid = pm.load_octomap(path)
    assert grid.voxel_size == res
    assert grid.num_frames == 0
    first, edge = np.array([leaf.first for leaf in octree.leaves]), np.array([leaf.edge for leaf in octree.leaves])
    # All voxels of all leaves have their leaf's log-odds, and no others are known.
    assert grid.num_observed == int((edge.astype(np.int64) ** 3).sum())
    expected = np.where(values > 0, OCTOMAP_LIMITS[1], OCTOMAP_LIMITS[0])
    for size in np.unique(edge):
        within = np.array(list(np.ndindex(size, size, size)))
        of = edge == size
        actual = grid.log_odds(centres((first[of][:, None] + within).reshape(-1, 3), res))
        np.testing.assert_allclose(actual, np.repeat(expected[of], len(within)), atol=UNIT)

    again = tmp_path / "again.bt"
    grid.save_octomap(again)
    if name == "fr_079.bt":
        assert nodes_of(again.read_bytes()) == nodes_of(path.read_bytes())
    else:
        # This file was not pruned after its probabilities had been rounded off to states.
        assert voxels(read_octree(again.read_bytes()).leaves) == voxels(octree.leaves)
        assert again.stat().st_size < path.stat().st_size


def test_any_header(tmp_path: Path) -> None:
    tree = down([7] * 16, 0.5)
    first = "# Octomap OcTree file, and more"
    lines = {"#": "a comment", "unknown": "word", "res": "2.5e-1", "id": "OcTree\r", "size": 17}
    grid = load(header(first, **lines) + nodes_of(ot_file(tree)), tmp_path)
    assert grid.voxel_size == 0.25
    assert known(grid) == {(32767, 32767, 32767): 0.5}


def test_colours_are_left_out(tmp_path: Path) -> None:
    tree = down([0] * 15, {3: 1.25, 6: -0.75})
    file = ot_file(tree, id="ColorOcTree")
    low = -32768
    assert known(load(file, tmp_path)) == {(low + 1, low + 1, low): 1.25, (low, low + 1, low + 1): -0.75}


@pytest.mark.parametrize("depth", range(9, 17))
def test_pruned_leaves_are_expanded(depth: int, tmp_path: Path) -> None:
    """From one voxel to a cube of 16 x 16 x 16 blocks."""
    way = [7, 0, 5, 2, 1, 3, 6, 4] * 2
    tree = down(way[:depth], 2.0)
    edge = 1 << 16 - depth
    (leaf,) = read_octree(ot_file(tree)).leaves
    assert leaf.edge == edge
    for file, value in ((ot_file(tree), 2.0), (bt_file(tree), OCTOMAP_LIMITS[1])):  # type: ignore[arg-type]
        grid = load(file, tmp_path)
        assert grid.num_observed == edge**3
        corners = np.array(leaf.first) + (edge - 1) * np.array(list(np.ndindex(2, 2, 2)))
        np.testing.assert_allclose(grid.log_odds(centres(corners, 0.1)), value, atol=UNIT)
        assert save(grid, tmp_path / "again.ot").nodes == depth + 1


@pytest.mark.parametrize("tree", [1.0, {0: -1.0}, down([1, 2, 3], 1.0)])
def test_a_leaf_may_not_fill_the_memory(tree: Tree, tmp_path: Path) -> None:
    files = [ot_file(tree), bt_file(tree)] if isinstance(tree, dict) else [ot_file(tree)]
    blocks = 8192**3 >> 3 * (count(tree) - 1)
    for file in files:
        with pytest.raises(OSError, match=f": its leaves come to {blocks} blocks .*, expected at most 16777216"):
            load(file, tmp_path)


@pytest.mark.parametrize("prior", [0.5, 0.3, 0.9])
def test_states_are_those_of_octomap(prior: float, tmp_path: Path) -> None:
    """Around 0, where OctoMap knows no unknown; and a map with another prior writes sums that others see as it does."""
    steps = [-1.0, -0.5, -0.25, -1e-9, 0.0, -0.0, 1e-9, 0.25, 0.5, 1.0]
    tree: Tree = {n: {m: UNIT * steps[5 * n + m] for m in range(5)} for n in range(2)}
    loaded = load(ot_file(down([0] * 14, tree)), tmp_path)
    octree = read_octree((tmp_path / "some.tree").read_bytes())
    assert len(octree.leaves) == len(steps)
    for voxel, value in voxels(octree.leaves).items():
        point = centres(np.array([voxel]), 0.1)
        assert loaded.state(point) == (value >= 0)
        assert abs(loaded.log_odds(point) - value) <= UNIT

    ours = map_of(random_frames(1, seed=3), voxel_size=0.1, prior=prior)
    written = voxels(save(ours, tmp_path / "ours.ot").leaves)
    assert written.keys() == known(ours).keys()
    states = ours.state(centres(np.array(list(written)), 0.1))
    np.testing.assert_array_equal(states, np.array(list(written.values())) >= 0)


# ---- there and back ----


def test_log_odds_come_back(grid: pm.OccupancyGrid, tmp_path: Path) -> None:
    octree = save(grid, tmp_path / "map.ot")
    assert voxels(octree.leaves) == known(grid)
    assert {leaf.edge for leaf in octree.leaves} >= {1, 2, 4}
    loaded = pm.load_octomap(tmp_path / "map.ot")
    np.testing.assert_array_equal(loaded.block_coords(), grid.block_coords())
    blocks = grid.block_coords()
    np.testing.assert_array_equal(loaded.block_log_odds(blocks), grid.block_log_odds(blocks))
    assert loaded.nbytes <= grid.nbytes


def test_states_come_back(grid: pm.OccupancyGrid, tmp_path: Path) -> None:
    octree = save(grid, tmp_path / "map.BT")
    states = {voxel: 1 if value > 0 else -1 for voxel, value in known(grid).items()}
    assert voxels(octree.leaves) == states
    loaded = known(pm.load_octomap(tmp_path / "map.BT"))
    assert {voxel: 1 if value > 0 else -1 for voxel, value in loaded.items()} == states


@pytest.mark.parametrize("ending", [".bt", ".ot"])
def test_nothing_could_be_pruned_more(ending: str, grid: pm.OccupancyGrid, tmp_path: Path) -> None:
    by_parent: dict[tuple[int, ...], list[Leaf]] = {}
    for leaf in save(grid, tmp_path / f"map{ending}").leaves:
        by_parent.setdefault((leaf.edge, *(c // (2 * leaf.edge) for c in leaf.first)), []).append(leaf)
    assert max(map(len, by_parent.values())) == 8
    assert all(len(leaves) < 8 or len({leaf.value for leaf in leaves}) > 1 for leaves in by_parent.values())


@pytest.mark.parametrize("ending", [".bt", ".ot"])
def test_an_empty_map(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"empty{ending}"
    pm.OccupancyGrid(voxel_size=0.125).save_octomap(path)
    assert path.read_bytes().endswith(b"id OcTree\nsize 0\nres 0.125\ndata\n")
    loaded = pm.load_octomap(path)
    assert (loaded.voxel_size, loaded.num_blocks) == (0.125, 0)


def test_parameters_of_a_loaded_map(tmp_path: Path) -> None:
    tree = down([7] * 15, {0: -5.0, 1: 4.0, 2: 1.0})
    loaded = load(ot_file(tree), tmp_path)
    assert (loaded.update, loaded.clamp, loaded.max_range, loaded.prior) == ("pyramid", None, 5.0, 0.5)
    assert sorted(known(loaded).values()) == [-5.0, 1.0, 4.0]

    clamped = load(ot_file(tree), tmp_path, clamp=pm.OCTOMAP_CLAMP, backend="cpu")
    assert clamped.clamp == pm.OCTOMAP_CLAMP == pytest.approx(OCTOMAP_LIMITS, abs=1e-12)
    np.testing.assert_allclose(sorted(known(clamped).values()), [OCTOMAP_LIMITS[0], 1.0, OCTOMAP_LIMITS[1]], atol=UNIT)

    # Voxels of any size: the range follows.
    assert load(ot_file(tree, res=20.0), tmp_path).max_range == 20.0
    assert load(ot_file(tree, res=1e-4), tmp_path).max_range == pytest.approx(0.4096)


def test_a_loaded_map_can_be_gone_on_with(grid: pm.OccupancyGrid, tmp_path: Path) -> None:
    """Merged into a map of other parameters, it is as if that had seen what the file's map saw."""
    frame = random_frames(1, seed=5)[0]
    grid.save_octomap(tmp_path / "map.ot")
    other = pm.OccupancyGrid(voxel_size=0.06, update="area", max_range=3.0)
    other.merge(pm.load_octomap(tmp_path / "map.ot"))
    other.integrate(*frame)
    expected = pm.OccupancyGrid(voxel_size=0.06, update="area", max_range=3.0)
    expected.integrate(*frame)
    expected.merge(grid)
    assert known(other) == known(expected)


# ---- the shell ----


def test_the_shell_takes_them_too(tmp_path: Path) -> None:
    office = write_office(tmp_path / "office")
    paths = {ending: tmp_path / f"office{ending}" for ending in (".pmap", ".ot", ".bt")}
    found = {}
    for ending, path in paths.items():
        run("map", office, "-r", "0.2", "-o", path, "--backend", "cpu")
        found[ending] = json_of(run("info", path, "--json"))["map"]
    for ending in (".ot", ".bt"):
        for name in ("voxel_size", "voxels_free", "voxels_occupied", "bounds", "blocks"):
            assert found[ending][name] == found[".pmap"][name], (ending, name)
    run("slice", paths[".bt"], "-o", tmp_path / "slice.png")
    assert png_bytes(tmp_path / "slice.png").any()
    ours, theirs = (
        json_of(run("mesh", paths[ending], "-o", tmp_path / f"m{ending}.ply", "--backend", "cpu", "--json"))["mesh"]
        for ending in (".pmap", ".ot")
    )
    assert ours == theirs
    (tmp_path / "damaged.bt").write_bytes(paths[".bt"].read_bytes()[:-1])
    assert "damaged.bt: cut off among its nodes" in run("info", tmp_path / "damaged.bt", code=1).stderr


# ---- errors ----


def test_an_ending_that_is_no_format(grid: pm.OccupancyGrid, tmp_path: Path) -> None:
    for name in ("map.pmap", "map"):
        with pytest.raises(ValueError, match=rf"path is \".*{name}\", expected an ending of .bt .* or .ot"):
            grid.save_octomap(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_map_beyond_the_keys(tmp_path: Path) -> None:
    frame = random_frames(1, seed=5)[0]
    for x, inside in ((3270.0, True), (3277.0, False), (-3273.0, True), (-3278.0, False)):
        frame.world_from_camera[0, 3] = x
        grid = map_of([frame], voxel_size=0.1)
        path = tmp_path / "far.bt"
        path.write_bytes(b"what was there")
        if inside:
            assert voxels(save(grid, path).leaves).keys() == known(grid).keys()
            continue
        with pytest.raises(ValueError, match=r"voxel \[.*\] lies beyond OctoMap's keys of 16 bits, .* -32768 to 32767"):
            grid.save_octomap(path)
        assert path.read_bytes() == b"what was there"


def test_files_that_cannot_be_reached(grid: pm.OccupancyGrid, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"none\.bt"):
        pm.load_octomap(tmp_path / "none.bt")
    with pytest.raises(FileNotFoundError, match="no_folder"):
        grid.save_octomap(tmp_path / "no_folder" / "map.bt")
    with pytest.raises(ValueError, match='backend is "abacus"'):
        pm.load_octomap(tmp_path / "none.bt", backend="abacus")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="clamp"):
        load(ot_file(down([0] * 16, 1.0)), tmp_path, clamp=(1.0, 2.0))


SOME = down([0, 7] * 8, 1.0)
BT, OT = "# Octomap OcTree binary file", "# Octomap OcTree file"


@pytest.mark.parametrize(
    ("file", "reason"),
    [
        (b"", "not an OctoMap file"),
        (b"PYRAMAP\0", "not an OctoMap file"),
        (b"# Octomap OcTree file", "not an OctoMap file"),
        (b"# Octomap OcTree file\nid OcTree\nsize 1\nres 1", "cut off in its header"),
        (header(OT, id="OcTree", size=0), 'no "res"'),
        (header(OT, id="OcTree", res=0.1), 'no "size"'),
        (header(BT, size=0, res=0.1), 'no "id"'),
        (header(OT, id="SemanticOcTree", size=0, res=0.1), 'type "SemanticOcTree", expected "OcTree"'),
        (header(OT, id="OcTree", size=-1, res=0.1), 'size is "-1"'),
        (header(OT, id="OcTree", size=0, res=-0.1), 'res is "-0.1"'),
        (header(OT, id="OcTree", size=0, res="nan"), 'res is "nan"'),
        (header(OT, id="OcTree", size=0, res="inf"), 'res is "inf"'),
        (header(OT, id="OcTree", size=0, res=""), 'no "res"'),
        (header(OT, id="OcTree", size=1, res=0.1), "cut off among its nodes"),
        (header(BT, id="OcTree", size=0, res=0.1) + b"\0", "1 bytes after the last node"),
        (ot_file(SOME) + b"12", "2 bytes after the last node"),
        (ot_file(SOME, size=16), "holds 17 nodes, its header says 16"),
        (bt_file(SOME, size=18), "holds 17 nodes, its header says 18"),  # type: ignore[arg-type]
        (header(BT, id="OcTree", size=1, res=0.1) + b"\0\0", "should have children has none"),
        (bt_file(down([1] * 17, 1.0)), "deeper than 16 levels"),  # type: ignore[arg-type]
        (ot_file(down([1] * 17, 1.0)), "deeper than 16 levels"),
        (ot_file(down([1] * 16, math.nan)), "log-odds of NaN"),
        (ot_file(down([1] * 16, math.inf)), "log-odds of inf"),
        (ot_file(down([1] * 16, -1e9)), "log-odds of -1000000000"),
    ],
)
def test_what_is_no_octree(file: bytes, reason: str, tmp_path: Path) -> None:
    with pytest.raises(OSError, match=rf"^{tmp_path}/some.tree: .*{reason}"):
        load(file, tmp_path)


@pytest.mark.parametrize("ending", [".bt", ".ot"])
def test_cut_off_anywhere(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"map{ending}"
    map_of(random_frames(1, seed=2), voxel_size=0.5).save_octomap(path)
    file = path.read_bytes()
    assert 200 < len(file) < 20_000
    for length in range(len(file)):
        with pytest.raises(OSError, match=r"some\.tree: "):
            load(file[:length], tmp_path)


@pytest.mark.parametrize("ending", [".bt", ".ot"])
def test_flipped_bits(ending: str, tmp_path: Path) -> None:
    """A map that can be read as one, or an error: there is no checksum that would tell more."""
    path = tmp_path / f"map{ending}"
    map_of(random_frames(1, seed=2), voxel_size=0.5).save_octomap(path)
    file, rng, refused = path.read_bytes(), np.random.default_rng(1), 0
    start = len(file) - len(nodes_of(file))
    for _ in range(2000):
        damaged = bytearray(file)
        for at in rng.integers(len(file), size=rng.integers(1, 4)):
            damaged[at] ^= 1 << rng.integers(8)
        try:
            loaded = load(bytes(damaged), tmp_path)
        except OSError as error:
            assert "some.tree: " in str(error)
            refused += 1
        else:
            leaves, _ = read_nodes(bytes(damaged[start:]), binary=ending == ".bt")
            assert loaded.num_observed == sum(leaf.edge**3 for leaf in leaves)
    assert 100 < refused < 2000


# ---- OctoMap itself ----


def test_octomap_reads_what_we_write(grid: pm.OccupancyGrid, tmp_path: Path) -> None:
    pyoctomap = pytest.importorskip("pyoctomap", reason="pyoctomap, OctoMap itself, is not installed")
    grid.save_octomap(tmp_path / "map.ot")
    grid.save_octomap(tmp_path / "map.bt")
    full = pyoctomap.OcTree(0.1).read(str(tmp_path / "map.ot"))
    assert full.getResolution() == 0.06
    assert voxels_of_pyoctomap(full) == known(grid)
    # It computes inner nodes and prunes as we do.
    full.updateInnerOccupancy()
    full.write(str(tmp_path / "theirs.ot"))
    assert (tmp_path / "theirs.ot").read_bytes() == (tmp_path / "map.ot").read_bytes()

    binary = pyoctomap.OcTree(0.1)
    assert binary.readBinary(str(tmp_path / "map.bt"))
    states = {voxel: value > 0 for voxel, value in voxels_of_pyoctomap(binary).items()}
    assert states == {voxel: value > 0 for voxel, value in known(grid).items()}
    binary.writeBinary(str(tmp_path / "theirs.bt"))
    assert (tmp_path / "theirs.bt").read_bytes() == (tmp_path / "map.bt").read_bytes()


def test_we_read_what_octomap_writes(tmp_path: Path) -> None:
    pyoctomap = pytest.importorskip("pyoctomap", reason="pyoctomap, OctoMap itself, is not installed")
    points = np.random.default_rng(4).normal(0.0, 2.0, (300, 3))
    for make in (pyoctomap.OcTree, pyoctomap.ColorOcTree):
        tree = make(0.1)
        tree.insertPointCloud(points, np.array([0.05, -0.31, 0.12]), max_range=3.0)
        tree.write(str(tmp_path / "theirs.ot"))
        loaded, theirs = known(pm.load_octomap(tmp_path / "theirs.ot")), voxels_of_pyoctomap(tree)
        assert loaded.keys() == theirs.keys()
        assert max(abs(loaded[voxel] - theirs[voxel]) for voxel in theirs) <= UNIT / 2
        tree.writeBinary(str(tmp_path / "theirs.bt"))
        loaded = known(pm.load_octomap(tmp_path / "theirs.bt"))
        assert {voxel: value > 0 for voxel, value in loaded.items()} == {v: value > 0 for v, value in theirs.items()}
