"""Reads recordings of the viewer back, with Rerun's own reader."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rerun.chunk import RrdReader


@dataclass(frozen=True)
class Row:
    """What was logged at once: components by name, and the place on each time line, none if it is for all times."""

    times: dict[str, Any]
    components: dict[str, Any]


def read_recording(path: Path) -> dict[str, list[Row]]:
    """The rows of each entity, in the order of their frames."""
    rows: dict[str, list[Row]] = defaultdict(list)
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for number in range(batch.num_rows):
            values = {name: batch.column(name)[number].as_py() for name in batch.schema.names}
            times = {name: values.pop(name) for name in chunk.timeline_names}
            components = {name: value for name, value in values.items() if ":" in name and value is not None}
            rows[chunk.entity_path.removeprefix("/")].append(Row(times, components))
    for several in rows.values():
        several.sort(key=lambda row: row.times.get("frame", -1))
    return dict(rows)
