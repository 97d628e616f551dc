"""What the README shows is true: its Python is run, and the states it prints are the ones that come out."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

README = (Path(__file__).parents[1] / "README.md").read_text()


def test_the_python_of_the_readme(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code, *more = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    said = re.search(r"grid\.state\((.*?)\)\s+# array\((.*?)\)", code)
    assert said is not None
    before_removal, after = code.split("grid.remove")
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(before_removal, names)
    states = names["grid"].state(eval(said[1]))
    assert np.array_equal(states, eval(said[2]))
    exec("grid.remove" + after, names)
    assert names["grid"].num_blocks == 0
    assert {path.name for path in tmp_path.iterdir()} == {"wall.ply", "wall.pmap"}
    assert len(more) == 2
    exec(more[0], names)
    assert names["hits"].state == [1] and len(names["frontiers"]) > 0
    exec(more[1], names)


@pytest.mark.parametrize("link", re.findall(r"\]\(((?!http)[^)#]+)\)", README))
def test_links_lead_somewhere(link: str) -> None:
    assert (Path(__file__).parents[1] / link).exists(), link
