"""The `.pmap` file: a whole map, or an error that names the file; and the same map always as the same bytes."""

from __future__ import annotations

import os
import resource
import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyramap as pm
import pytest
from frames import make_grid, map_bytes, map_of, random_frames, wall
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

MAGIC = b"PYRAMAP\0"
VERSION = struct.pack("<I", 2)
PREAMBLE = len(MAGIC + VERSION)
FRAMES = random_frames(3, seed=8)


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The file of a small map with a few blocks of each kind."""
    return map_bytes(map_of(FRAMES[:1], voxel_size=0.2), tmp_path_factory.mktemp("saved"))


class Section(NamedTuple):
    """One section of a file, written with the checksum that belongs to it unless told otherwise."""

    tag: bytes
    payload: bytes
    length: int | None = None

    def to_bytes(self) -> bytes:
        length = struct.pack("<Q", len(self.payload) if self.length is None else self.length)
        checksum = zlib.crc32(self.tag + length + self.payload)
        return self.tag + length + struct.pack("<I", checksum) + self.payload


def sections_of(file: bytes) -> list[Section]:
    sections, at = [], PREAMBLE
    while at < len(file):
        tag, length, _ = struct.unpack_from("<4sQI", file, at)
        sections.append(Section(tag, file[at + 16 : at + 16 + length]))
        at += 16 + length
    return sections


def file_of(sections: list[Section]) -> bytes:
    return MAGIC + VERSION + b"".join(section.to_bytes() for section in sections)


def varint(number: int) -> bytes:
    """Unsigned LEB128, as postcard writes lengths and numbers."""
    out = bytearray()
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*out, number])


def stored(plain: bytes) -> bytes:
    """A zstd frame (RFC 8878) of raw blocks: nothing is compressed, so no library is needed."""
    chunks = [plain[i : i + 0x10000] for i in range(0, len(plain), 0x10000)] or [b""]
    headers = [(len(chunk) << 3 | (i == len(chunks) - 1)).to_bytes(3, "little") for i, chunk in enumerate(chunks)]
    blocks = b"".join(header + chunk for header, chunk in zip(headers, chunks, strict=True))
    return b"\x28\xb5\x2f\xfd" + b"\x00" + b"\x50" + blocks


def repeated(byte: int, count: int) -> bytes:
    """A zstd frame of run-length blocks: four bytes for every 128 KiB."""
    blocks, left = b"", count
    while left:
        size = min(left, 0x20000)
        left -= size
        blocks += (size << 3 | 1 << 1 | (left == 0)).to_bytes(3, "little") + bytes([byte])
    return b"\x28\xb5\x2f\xfd" + b"\x00" + b"\x50" + blocks


seeded = settings(
    max_examples=300,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],  # each example writes over the last one's file
)

Damaged = Callable[..., None]


@pytest.fixture
def refuses(tmp_path: Path) -> Damaged:
    path = tmp_path / "damaged.pmap"

    def check(file: bytes, reason: str = "") -> None:
        path.write_bytes(file)
        with pytest.raises(OSError, match=rf"^{path}: .*{reason}"):
            pm.OccupancyGrid.load(path)

    return check


# ---- round trip ----


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"update": "area"},
        {"update": "min_layer", "beyond_max_range": "ignore"},
        {"update": "ideal", "prior": 0.3},
        {"clamp": (-2.0, 3.5), "max_bytes": 123_456_789},
        {"sensor_model": pm.SensorModel(0.04, k=0.03, surface_offset=0.0125), "max_range": 2.5},
        {"sensor_model": pm.SensorModel((0.01, 0.002, 0.003), surface_offset="centred"), "voxel_size": 0.07},
    ],
)
def test_round_trip(options: dict[str, Any], tmp_path: Path) -> None:
    frames = FRAMES[:1] if options.get("update") == "ideal" else FRAMES
    grid = map_of(frames, **options)
    path = tmp_path / "map.pmap"
    grid.save(path)
    loaded = pm.OccupancyGrid.load(path)
    for name in (
        *("voxel_size", "sensor_model", "max_range", "update", "clamp", "max_bytes", "prior", "beyond_max_range"),
        *("backend", "num_blocks", "num_observed", "num_frames", "saturated", "nbytes"),
    ):
        assert getattr(loaded, name) == getattr(grid, name), name
    coords = grid.block_coords()
    assert (coords < 0).any()
    np.testing.assert_array_equal(loaded.block_coords(), coords)
    np.testing.assert_array_equal(loaded.block_log_odds(coords), grid.block_log_odds(coords))
    assert map_bytes(loaded, tmp_path) == path.read_bytes()


def test_a_loaded_map_goes_on_like_the_first(tmp_path: Path) -> None:
    grid = map_of(FRAMES[:2])
    grid.save(tmp_path / "map.pmap")
    loaded = pm.OccupancyGrid.load(tmp_path / "map.pmap", backend="cpu")
    for other in (grid, loaded):
        other.integrate(*FRAMES[2])
        other.remove(*FRAMES[0])
    assert map_bytes(loaded, tmp_path) == map_bytes(grid, tmp_path)


def test_the_empty_map(tmp_path: Path) -> None:
    path = tmp_path / "empty.pmap"
    make_grid().save(path)
    assert pm.OccupancyGrid.load(path).num_blocks == 0
    assert [section.tag for section in sections_of(path.read_bytes())] == [b"HEAD", b"DONE"]


def test_more_blocks_than_one_section_holds(tmp_path: Path) -> None:
    grid = map_of([wall(2.9)], voxel_size=0.01)
    assert grid.num_blocks > 4096
    file = map_bytes(grid, tmp_path)
    assert [section.tag for section in sections_of(file)].count(b"BLKS") == -(-grid.num_blocks // 4096)
    loaded = pm.OccupancyGrid.load(tmp_path / "bytes.pmap")
    coords = grid.block_coords()
    np.testing.assert_array_equal(loaded.block_coords(), coords)
    np.testing.assert_array_equal(loaded.block_log_odds(coords), grid.block_log_odds(coords))


def test_path_may_be_a_str_or_a_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    grid = map_of(FRAMES[:1])
    monkeypatch.chdir(tmp_path)
    for path in ("plain.pmap", str(tmp_path / "str.pmap"), tmp_path / "path.pmap", Path("Küche 厨房.pmap")):
        grid.save(path)
        assert map_bytes(pm.OccupancyGrid.load(path), tmp_path) == Path(path).read_bytes()
    with pytest.raises(TypeError):
        grid.save(3)  # type: ignore[arg-type]


def test_an_unknown_backend_is_refused_at_load(saved: bytes, tmp_path: Path) -> None:
    path = tmp_path / "map.pmap"
    path.write_bytes(saved)
    with pytest.raises(ValueError, match='backend is "cuda", expected "auto" or "cpu" or "gpu"'):
        pm.OccupancyGrid.load(path, backend="cuda")  # type: ignore[arg-type]


# ---- damage ----


def test_every_truncation_is_noticed(saved: bytes, refuses: Damaged) -> None:
    lengths = {*range(0, 120), *range(len(saved) - 40, len(saved)), *range(0, len(saved), max(1, len(saved) // 150))}
    for length in sorted(lengths):
        refuses(saved[:length])


def test_every_flipped_bit_is_noticed(saved: bytes, refuses: Damaged) -> None:
    rng = np.random.default_rng(9)
    positions = {*range(0, 120), *range(len(saved) - 40, len(saved)), *rng.integers(0, len(saved), 200).tolist()}
    for position in sorted(positions):
        altered = bytearray(saved)
        altered[position] ^= 1 << int(rng.integers(8))
        refuses(bytes(altered))


@pytest.mark.parametrize(
    ("file", "reason"),
    [
        (b"", "not a pyramap map"),
        (b"PYRAMAP", "not a pyramap map"),
        (b"ply\nformat ascii 1.0\n", "not a pyramap map"),
        (MAGIC, "cut off"),
        (MAGIC + struct.pack("<I", 0), "format version 0, this program reads 1 to 3"),
        (MAGIC + struct.pack("<I", 4), "format version 4, this program reads 1 to 3"),
        (MAGIC + struct.pack("<I", 2**32 - 1), "format version 4294967295"),
        (MAGIC + VERSION, "cut off"),
    ],
)
def test_foreign_files(file: bytes, reason: str, refuses: Damaged) -> None:
    refuses(file, reason)


def test_a_picture_is_no_map(tmp_path: Path) -> None:
    path = tmp_path / "kitchen.pmap"
    Image.fromarray(np.zeros((4, 4), np.uint8)).save(path, format="png")
    with pytest.raises(OSError, match=r"kitchen\.pmap: not a pyramap map"):
        pm.OccupancyGrid.load(path)


def test_sections_are_checked_one_by_one(saved: bytes, refuses: Damaged) -> None:
    head, *blocks, done = sections_of(saved)
    assert [section.tag for section in (head, *blocks, done)] == [b"HEAD", b"BLKS", b"DONE"]
    assert file_of([head, *blocks, done]) == saved
    refuses(file_of([*blocks, done]), "the parameters are missing")
    refuses(file_of([head, *blocks]), "cut off between sections")
    refuses(file_of([head, done]), r"holds 0 blocks, its head says \d+")
    refuses(file_of([head, *blocks, *blocks, done]), r"holds \d+ blocks, its head says \d+")
    refuses(file_of([head, *blocks, head, done]), "unknown section")
    refuses(file_of([head, Section(b"EVIL", b"1"), *blocks, done]), 'unknown section "EVIL"')
    refuses(file_of([head, *blocks, Section(b"DONE", b"more")]), "bytes after the end")
    refuses(saved + b"\0", "bytes after the end")
    refuses(file_of([Section(b"HEAD", b""), *blocks, done]), "unreadable parameters")
    refuses(file_of([Section(b"HEAD", head.payload[:-1]), *blocks, done]), "unreadable parameters")
    refuses(file_of([head, Section(b"BLKS", b""), done]), "")
    refuses(file_of([head, Section(b"BLKS", b"no zstd"), done]), "blocks do not unpack")
    refuses(file_of([head, Section(b"BLKS", blocks[0].payload[:-1]), done]), "blocks do not unpack")


@pytest.mark.parametrize("length", [2**64 - 1, 2**63, 2**40, 10**6])
def test_lengths_in_the_file_are_not_trusted(length: int, saved: bytes, refuses: Damaged) -> None:
    head, *blocks, done = sections_of(saved)
    refuses(file_of([Section(b"HEAD", head.payload, length), *blocks, done]), "cut off inside a section")
    refuses(file_of([head, Section(b"BLKS", blocks[0].payload, length), done]), "cut off inside a section")


def record(key: tuple[int, int, int], value: int) -> bytes:
    """A block of one value as postcard writes it: zigzag numbers, and 0 for the first kind of content."""
    return b"".join(varint(2 * n if n >= 0 else -2 * n - 1) for n in key) + b"\0" + varint(2 * value)


def with_blocks(saved: bytes, records: list[bytes], count: int | None = None) -> bytes:
    """The file with other blocks; its head still counts the old ones."""
    head, *_, done = sections_of(saved)
    payload = stored(varint(len(records) if count is None else count) + b"".join(records))
    return file_of([head, Section(b"BLKS", payload), done])


def test_blocks_are_checked_one_by_one(saved: bytes, refuses: Damaged, tmp_path: Path) -> None:
    path = tmp_path / "forged.pmap"
    path.write_bytes(saved)
    count = pm.OccupancyGrid.load(path).num_blocks
    ascending = [record((i, 0, 0), 7) for i in range(count)]
    path.write_bytes(with_blocks(saved, ascending))
    forged = pm.OccupancyGrid.load(path)  # so the files below fail for what is wrong with them, and not for the forgery
    assert forged.block_coords()[:, 0].tolist() == list(range(count))
    assert set(forged.block_log_odds(forged.block_coords()).ravel().tolist()) == {7 / 4096}

    refuses(with_blocks(saved, ascending[::-1]), "blocks are not in order")
    refuses(with_blocks(saved, ascending[:-1] + ascending[-2:-1]), "blocks are not in order")
    refuses(with_blocks(saved, ascending[:-1]), f"holds {count - 1} blocks, its head says {count}")
    for beyond in (2**27 + 1, 2**31 - 1):
        refuses(
            with_blocks(saved, [*ascending[:-1], record((beyond, 0, 0), 7)]), rf"block \[{beyond}, 0, 0\] lies beyond"
        )
    refuses(with_blocks(saved, [record((-(2**31), 0, 0), 7), *ascending[1:]]), "lies beyond the coordinates")
    short = b"\0\0\0" + b"\1" + varint(511) + b"\0" * 511
    refuses(with_blocks(saved, [short, *ascending[1:]]), r"block \[0, 0, 0\] has 511 voxels, expected 512")
    refuses(with_blocks(saved, [b"\0\0\0\2\0", *ascending[1:]]), "unreadable blocks")
    refuses(with_blocks(saved, ascending, count=2**60), "unreadable blocks")
    refuses(with_blocks(saved, [b"\0\0\0\1" + varint(2**60)]), "unreadable blocks")


def test_a_bomb_does_not_go_off(saved: bytes, refuses: Damaged, tmp_path: Path) -> None:
    """A few kilobytes that unpack to gigabytes are refused while they unpack."""
    head, *_, done = sections_of(saved)
    many = varint(2_000_000) + b"\0\0\0\0\2" * 2_000_000  # as blocks in memory: 4 GB
    assert len(repeated(0, 2**32)) < 200_000
    with limited_memory(2**30):
        for payload in (repeated(0, 2**32), stored(many)):
            file = file_of([head, Section(b"BLKS", payload), done])
            refuses(file, "a section of blocks is larger than any map writes")


@contextmanager
def limited_memory(more: int) -> Iterator[None]:
    """Lets this process take no more address space than it has, and this much."""
    pages = int(Path("/proc/self/statm").read_text().split()[0]) if Path("/proc/self/statm").exists() else 0
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    if pages:
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + more, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1.0, 1e300])
@pytest.mark.parametrize(
    ("name", "at", "present"),
    [
        ("voxel_size", 0, 0.2),
        ("sigma", 8, 0.2),
        ("sigma", 16, 0.0),
        ("sigma", 24, 0.0),
        ("k", 32, 1.0),  # k / sigma
        ("surface_offset", 41, 0.0),
        ("max_range", 49, 3.0),
        ("prior", 61, 0.5),
    ],
)
def test_parameters_in_the_file_are_checked(
    name: str, at: int, present: float, value: float, saved: bytes, refuses: Damaged, tmp_path: Path
) -> None:
    head, *rest = sections_of(saved)
    assert struct.unpack_from("<d", head.payload, at) == (present,)
    file = file_of([Section(b"HEAD", head.payload[:at] + struct.pack("<d", value) + head.payload[at + 8 :]), *rest])
    if (name == "surface_offset" and np.isfinite(value)) or (name, value) == ("sigma", 1e300):
        path = tmp_path / "odd.pmap"
        path.write_bytes(file)
        grid = pm.OccupancyGrid.load(path)  # nothing that a model could not be made with
        grid.integrate(*FRAMES[0])
        assert np.isfinite(grid.block_log_odds(grid.block_coords())).all()
    else:
        refuses(file, "bad parameters: .* is .*, expected")


@pytest.mark.parametrize(
    ("decays", "product", "possible"),
    [
        *((0, 1.0, True), (0, 0.5, False), (0, float("nan"), False)),
        *((3, 0.5, True), (3, 0.0, True), (3, 1.0, False), (3, -0.5, False), (3, 2.0, False), (3, float("nan"), False)),
    ],
)
def test_the_history_in_the_file_is_checked(
    decays: int, product: float, possible: bool, saved: bytes, refuses: Damaged, tmp_path: Path
) -> None:
    head, *rest = sections_of(saved)
    parameters, none = head.payload[:-10], head.payload[-10:]
    assert none == b"\0" + struct.pack("<d", 1.0) + b"\0"  # no decays, their product, no erasures
    file = file_of([Section(b"HEAD", parameters + bytes([decays]) + struct.pack("<d", product) + b"\7"), *rest])
    if possible:
        path = tmp_path / "history.pmap"
        path.write_bytes(file)
        grid = pm.OccupancyGrid.load(path)
        assert (grid.num_decays, grid.decay_product, grid.num_erasures) == (decays, product, 7)
    else:
        refuses(file, f"bad parameters: decay_product is .* of {decays} decays, expected")


@seeded
@given(tail=st.binary(max_size=400))
def test_any_bytes_after_the_magic(tail: bytes, refuses: Damaged) -> None:
    refuses(MAGIC + VERSION + tail)


@seeded
@given(head=st.binary(max_size=200), plain=st.binary(max_size=200), data=st.data())
def test_any_contents_with_right_checksums(
    head: bytes, plain: bytes, data: st.DataObject, saved: bytes, tmp_path: Path
) -> None:
    """Whatever the sections hold: a map, if it happens to be one, or an OSError."""
    good = sections_of(saved)[0].payload
    sections = [
        Section(b"HEAD", data.draw(st.sampled_from([good, head, good[: len(head) // 3] + head]))),
        Section(b"BLKS", data.draw(st.sampled_from([plain, stored(plain)]))),
        Section(b"DONE", b""),
    ]
    path = tmp_path / "any.pmap"
    path.write_bytes(file_of(sections))
    try:
        grid = pm.OccupancyGrid.load(path)
    except OSError as error:
        assert str(error).startswith(f"{path}: ")
    else:
        assert grid.num_blocks >= 0


# ---- the file system ----


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"none\.pmap: No such file"):
        pm.OccupancyGrid.load(tmp_path / "none.pmap")


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(OSError, match=f"^{tmp_path}: "):
        pm.OccupancyGrid.load(tmp_path)
    folder = tmp_path / "folder"
    folder.mkdir()
    with pytest.raises(OSError, match=f"^{folder}: "):
        map_of(FRAMES[:1]).save(folder)
    assert list(tmp_path.iterdir()) == [folder]
    assert list(folder.iterdir()) == []


def test_no_place_to_write(tmp_path: Path) -> None:
    grid = map_of(FRAMES[:1])
    with pytest.raises(FileNotFoundError, match=r"none/map\.pmap: "):
        grid.save(tmp_path / "none" / "map.pmap")
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match=r"file/map\.pmap: "):
        grid.save(tmp_path / "file" / "map.pmap")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@contextmanager
def read_only(folder: Path) -> Iterator[None]:
    """Nobody may write to the folder, not even who may everything."""
    user = os.geteuid()
    folder.chmod(0o555)
    if user == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(user)
        folder.chmod(0o755)


def test_a_folder_that_may_not_be_written(tmp_path: Path) -> None:
    grid = map_of(FRAMES[:1])
    with read_only(tmp_path), pytest.raises(PermissionError, match=r"map\.pmap: Permission denied"):
        grid.save(tmp_path / "map.pmap")
    assert list(tmp_path.iterdir()) == []


@contextmanager
def full_disk(size: int) -> Iterator[None]:
    """Lets no file of this process grow beyond a size: writing fails then, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_save_that_fails_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "map.pmap"
    map_of(FRAMES[:1]).save(path)
    old = path.read_bytes()
    grid = map_of(FRAMES)
    assert len(map_bytes(grid, tmp_path.parent)) > 1024
    with full_disk(1024), pytest.raises(OSError, match=f"^{path}: "):
        grid.save(path)
    assert path.read_bytes() == old
    assert list(tmp_path.iterdir()) == [path]


def test_a_save_replaces_the_old_file_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "map.pmap"
    for count in (1, 3, 2):
        map_of(FRAMES[:count]).save(path)
        assert pm.OccupancyGrid.load(path).num_frames == count
    assert list(tmp_path.iterdir()) == [path]
    assert path.stat().st_mode & 0o777 == 0o644
