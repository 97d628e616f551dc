"""OctoMap's files, read and written naively, node by node."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pyramap as pm
from numpy.typing import NDArray

Voxel = tuple[int, int, int]

# A leaf's log-odds, or children by number: x in the lowest bit.
Tree: TypeAlias = "float | dict[int, Tree]"

ROOT_EDGE = 1 << 16


class Leaf(NamedTuple):
    first: Voxel
    edge: int
    value: float


class Octree(NamedTuple):
    header: dict[str, str]
    leaves: list[Leaf]
    nodes: int


def read_octree(file: bytes) -> Octree:
    """The leaves of a `.bt`, whose values are 1 and -1, or an `.ot`."""
    text, _, data = file.partition(b"\ndata\n")
    lines = text.decode().splitlines()
    header = dict(line.split(maxsplit=1) for line in lines if not line.startswith("#"))
    return Octree(header, *read_nodes(data, binary="binary" in lines[0]))


def read_nodes(data: bytes, binary: bool) -> tuple[list[Leaf], int]:
    """Leaves, and the number of all nodes."""
    leaves, nodes, end = [], 0, 0
    for leaf, end in (_walk_bt if binary else _walk_ot)(data):  # noqa: B007
        nodes += 1
        if leaf:
            leaves.append(leaf)
    assert end == len(data)
    return leaves, nodes


def _child(first: Voxel, edge: int, n: int) -> Voxel:
    half = edge // 2
    return first[0] + (n & 1) * half, first[1] + (n >> 1 & 1) * half, first[2] + (n >> 2) * half


def _walk_bt(data: bytes) -> Iterator[tuple[Leaf | None, int]]:
    low = -ROOT_EDGE // 2
    stack: list[tuple[Voxel, int]] = [((low, low, low), ROOT_EDGE)]
    at = 0
    while stack:
        first, edge = stack.pop()
        bits = data[at] | data[at + 1] << 8
        at += 2
        yield None, at
        inner = []
        for n in range(8):
            kind = bits >> 2 * n & 3
            if kind == 3:
                inner.append((_child(first, edge, n), edge // 2))
            elif kind:
                yield Leaf(_child(first, edge, n), edge // 2, -1 if kind == 1 else 1), at
        stack += reversed(inner)


def _walk_ot(data: bytes) -> Iterator[tuple[Leaf | None, int]]:
    low = -ROOT_EDGE // 2
    stack: list[tuple[Voxel, int]] = [((low, low, low), ROOT_EDGE)]
    at = 0
    while stack:
        first, edge = stack.pop()
        value, children = struct.unpack_from("<fB", data, at)
        at += 5
        yield (None if children else Leaf(first, edge, value)), at
        stack += [(_child(first, edge, n), edge // 2) for n in reversed(range(8)) if children >> n & 1]


def voxels(leaves: list[Leaf]) -> dict[Voxel, float]:
    """All voxels of all leaves."""
    found = {}
    for (x, y, z), edge, value in leaves:
        for n in np.ndindex(edge, edge, edge):
            found[x + n[0], y + n[1], z + n[2]] = value
    return found


def voxels_of_pyoctomap(tree: Any) -> dict[Voxel, float]:
    """Log-odds of all voxels of a tree of OctoMap itself."""
    res, leaves = tree.getResolution(), []
    for leaf in tree.begin_leafs():
        edge = 1 << 16 - leaf.getDepth()
        x, y, z = (round(c / res - edge / 2) for c in leaf.getCoordinate())
        leaves.append(Leaf((x, y, z), edge, leaf.current_node.getLogOdds()))
    return voxels(leaves)


def known(grid: pm.OccupancyGrid) -> dict[Voxel, float]:
    """Log-odds of all voxels of a map that are not unknown."""
    blocks = grid.block_coords()
    log_odds = grid.block_log_odds(blocks)
    at = np.argwhere(log_odds != 0)
    voxel = 8 * blocks[at[:, 0]] + at[:, 1:]
    return {(x, y, z): value for (x, y, z), value in zip(voxel.tolist(), log_odds[tuple(at.T)].tolist(), strict=True)}


def down(way: list[int], end: Tree) -> Tree:
    """A node from which one child after the other leads to `end`."""
    for n in reversed(way):
        end = {n: end}
    return end


def count(tree: Tree) -> int:
    return 1 + sum(map(count, tree.values())) if isinstance(tree, dict) else 1


def header(first: str, **lines: Any) -> bytes:
    return "\n".join([first, *(f"{word} {value}" for word, value in lines.items()), "data\n"]).encode()


def ot_file(tree: Tree, res: float = 0.1, id: str = "OcTree", size: int | None = None) -> bytes:
    colour = b"\x01\x02\x03" if id == "ColorOcTree" else b""

    def node(tree: Tree) -> bytes:
        if not isinstance(tree, dict):
            return struct.pack("<f", tree) + colour + b"\0"
        children = sum(1 << n for n in tree)
        # What an inner node says is of no account.
        return struct.pack("<f", 77.0) + colour + bytes([children]) + b"".join(node(tree[n]) for n in sorted(tree))

    lines = {"id": id, "size": count(tree) if size is None else size, "res": res}
    return header("# Octomap OcTree file", **lines) + node(tree)


def bt_file(tree: dict[int, Tree], res: float = 0.1, size: int | None = None) -> bytes:
    def node(tree: dict[int, Tree]) -> bytes:
        kinds = {n: 3 if isinstance(child, dict) else 1 if child < 0 else 2 for n, child in tree.items()}
        bits = sum(kind << 2 * n for n, kind in kinds.items())
        inner = (child for _, child in sorted(tree.items()) if isinstance(child, dict))
        return struct.pack("<H", bits) + b"".join(map(node, inner))

    lines = {"id": "OcTree", "size": count(tree) if size is None else size, "res": res}
    return header("# Octomap OcTree binary file", **lines) + node(tree)


def centres(voxels: NDArray[np.int64], voxel_size: float) -> NDArray[np.float64]:
    """World points, metres."""
    return np.asarray((voxels + 0.5) * voxel_size, np.float64)
