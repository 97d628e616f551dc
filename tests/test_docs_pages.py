"""The pages of the documentation are true: their code runs, and what they point to is there."""

from __future__ import annotations

import importlib.util
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pyramap as pm
import pytest
from bag_files import BASE, OPTICAL, TF_STATIC, WORLD, image, info, transform, write_bag
from dataset_files import stored_image
from export_files import write_kitti
from shell import write_office

DOCS = Path(__file__).parents[1] / "docs"
PAGES = {str(page.relative_to(DOCS)): page for page in DOCS.rglob("*.md") if "generated" not in page.parts}
MADE_AT_BUILD = {"first_map.md", "howto/look_at_a_map.md"}
"""These are followed whenever the pages are built, and take longer."""


def load(name: str) -> ModuleType:
    """One of the modules that build the pages."""
    spec = importlib.util.spec_from_file_location(name, DOCS / "_ext" / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # where data classes look for it
    spec.loader.exec_module(module)
    return module


follow = load("follow")
WITH_CODE = [name for name, page in PAGES.items() if list(follow.steps_of(page.read_text()))]


def write_walk(folder: Path) -> None:
    messages = [info(), transform(0, BASE, OPTICAL, (0.6, (0.1, 0.2, 0.3)), TF_STATIC)]
    for n in range(4):
        messages += [transform(n / 10, WORLD, BASE, (0.2 * n, (n, 0.0, 0.0))), image(n / 10, stored_image(n), "16UC1")]
    shutil.move(write_bag(folder / "bag", "mcap", messages), folder / "walk.mcap")


FILES = {
    "howto/datasets.md": (lambda folder: write_office(folder / "recording"), write_kitti),
    "howto/ros.md": (write_walk,),
}
"""What must be there for the code of a page to run."""


def test_pages_with_code_are_found() -> None:
    assert MADE_AT_BUILD | set(FILES) | {"concepts/group.md", "howto/camera.md"} <= set(WITH_CODE)


@pytest.mark.parametrize("name", sorted(set(WITH_CODE) - MADE_AT_BUILD))
def test_the_code_of_a_page(name: str, tmp_path: Path) -> None:
    for write in FILES.get(name, ()):
        write(tmp_path)
    command = [sys.executable, "-W", "error", str(DOCS / "_ext/follow.py"), str(tmp_path), str(PAGES[name])]
    result = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_a_page_that_is_wrong_is_noticed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "```python\nx = 1\n```\n\n% not run: for a reason\n```python\n1 / 0\n```\n\n```sh\necho a b c\n```\n\n"
    )
    assert follow.follow(page, tmp_path) == 2
    for wrong in ("```python\nprint(x)\n```\n\n```text\n2\n```\n", "```python\ny\n```\n", "```sh\nfalse\n```\n"):
        page.write_text("```python\nx = 1\n```\n\n" + wrong)
        with pytest.raises((SystemExit, NameError, subprocess.CalledProcessError)):
            follow.follow(page, tmp_path)
    page.write_text("```sh\necho a b c\n```\n\n```text\na ... c\n```\n")
    assert follow.follow(page, tmp_path) == 1


def src_places() -> list[tuple[str, str]]:
    return [(name, place) for name, page in PAGES.items() for place in re.findall(r"\{src\}`(.+?)`", page.read_text())]


def test_the_code_that_pages_point_to_is_there(tmp_path: Path) -> None:
    pytest.importorskip("sphinx", reason="the extra docs is not installed")
    problem_of = load("source_names").problem_of
    places = src_places()
    assert len(places) > 30
    assert [(name, problem) for name, place in places if (problem := problem_of(place))] == []
    (tmp_path / "a.rs").write_text("fn here() {}\n// not there\n")
    assert problem_of("a.rs::here", tmp_path) is None
    assert "defines no there" in problem_of("a.rs::there", tmp_path)
    assert "no file b.rs" in problem_of("b.rs", tmp_path)


def test_every_equation_is_on_the_page_of_the_method() -> None:
    numbers = re.findall(r"\\quad \((\d+)\)", PAGES["method.md"].read_text())
    assert [int(number) for number in numbers] == list(range(1, 18))


def test_every_format_is_on_the_page_of_data_sets() -> None:
    page = PAGES["howto/datasets.md"].read_text()
    names = [format.name for format in pm.datasets.FORMATS] + [format.name for format in pm.datasets.SCAN_FORMATS]
    assert [name for name in names if f"| {name}" not in page] == []


@pytest.mark.parametrize("name", PAGES)
def test_links_lead_somewhere(name: str) -> None:
    page = PAGES[name]
    links = re.findall(r"\]\(((?!http)[^)#]+)", page.read_text())
    assert [link for link in links if "generated/" not in link and not (page.parent / link).exists()] == []


def test_notebooks_hold_no_output() -> None:
    """Their pictures are made by the build; kept here they would be out of date, and make every change a large one."""
    notebooks = list((DOCS / "notebooks").glob("*.ipynb"))
    assert notebooks
    for notebook in notebooks:
        cells = [cell for cell in json.loads(notebook.read_text())["cells"] if cell["cell_type"] == "code"]
        assert cells and not any(cell["outputs"] or cell["execution_count"] for cell in cells)
