"""What is released is whole: the distribution's metadata, the source distribution, the crates, and how to cite it."""

from __future__ import annotations

import importlib.metadata
import json
import re
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml
from pyramap import _core
from pyramap.pictures import rendering
from shell import run

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
LOCK = tomllib.loads((ROOT / "Cargo.lock").read_text())
LICENCES = ("LICENSE-MIT", "LICENSE-APACHE")
CRATES = {
    "pyramap": "crates/pyramap",
    "pyramap-scenes": "crates/pyramap-scenes",
    "pyramap-shaders": "shaders",
    "pyramap-wgpu": "crates/pyramap-wgpu",
}
"""Those to be published, and where they are."""
OF_EXTRAS = ("lzfse", "myst_nb", "rerun", "rosbags", "sphinx")
"""Modules that only an extra installs."""


def said_by(*command: object) -> str:
    result = subprocess.run([str(part) for part in command], cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return result.stdout


def cargo_metadata(*arguments: object) -> Any:
    return json.loads(said_by("cargo", "metadata", "--format-version", "1", *arguments))


@pytest.fixture(scope="module")
def packages() -> dict[str, Any]:
    """What cargo knows of the packages of the workspace, by name."""
    return {package["name"]: package for package in cargo_metadata("--no-deps", "--locked")["packages"]}


def sources(folder: Path) -> set[Path]:
    """The files below a folder that somebody wrote."""
    made = {"__pycache__", ".ruff_cache", ".mypy_cache"}
    return {
        path
        for path in folder.rglob("*")
        if path.is_file() and not made & set(path.parts) and path.suffix not in (".so", ".pyd")
    }


# --- the Python distribution ------------------------------------------------------------------------------------------


def test_the_metadata_of_the_distribution() -> None:
    about = importlib.metadata.metadata("pyramap")
    assert about["Requires-Python"] == ">=3.11"
    assert about["License-Expression"] == "MIT OR Apache-2.0"
    assert set(about.get_all("License-File") or []) == set(LICENCES)
    assert set(about.get_all("Provides-Extra") or []) == {"datasets", "dev", "docs", "ros", "viz"}
    (command,) = importlib.metadata.distribution("pyramap").entry_points
    assert (command.group, command.name, command.value) == ("console_scripts", "pyramap", "pyramap.cli:main")


def test_one_extension_serves_all_versions_of_python() -> None:
    name = Path(_core.__file__).name
    assert name == ("_core.pyd" if sys.platform == "win32" else "_core.abi3.so")
    workspace = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]
    oldest = PROJECT["requires-python"].removeprefix(">=")
    assert f"abi3-py{oldest.replace('.', '')}" in workspace["dependencies"]["pyo3"]["features"]


def test_developers_get_every_extra() -> None:
    extras = PROJECT["optional-dependencies"]
    assert f"pyramap[{','.join(sorted(extras.keys() - {'dev'}))}]" in extras["dev"]


def test_every_module_can_be_imported_without_the_extras() -> None:
    code = f"""
import importlib, pkgutil, sys
for name in {OF_EXTRAS}:
    sys.modules[name] = None
import pyramap
for module in pkgutil.walk_packages(pyramap.__path__, "pyramap."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
        print(module.name)
"""
    imported = said_by(sys.executable, "-c", code).split()
    assert {"pyramap.cli.demo", "pyramap.datasets.ros", "pyramap.datasets.record3d"} <= set(imported)


def test_without_embreex_the_demo_draws_the_slice_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rendering, "EmbreeScene", None)
    said = run("demo", "-o", tmp_path, "-r", "0.2", "--limit", "2")
    assert said.stderr.startswith("note: meshes cannot be drawn here: the package embreex is missing")
    assert {path.name for path in tmp_path.iterdir()} == {"office_loop.pmap", "office_loop.ply", "slice.png"}

    said = run("mesh", tmp_path / "office_loop.pmap", "-o", tmp_path / "m.ply", "--png", tmp_path / "m.png", code=1)
    assert "error: meshes cannot be drawn here: the package embreex is missing" in said.stderr


# --- the source distribution ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that the source distribution unpacks to."""
    folder = tmp_path_factory.mktemp("sdist")
    said_by(Path(sys.executable).with_name("maturin"), "sdist", "--out", folder)
    (archive,) = folder.glob("*.tar.gz")
    with tarfile.open(archive) as tar:
        tar.extractall(folder, filter="data")
    return folder / archive.name.removesuffix(".tar.gz")


def test_the_source_distribution_holds_all_that_a_build_needs(unpacked: Path) -> None:
    needed = {ROOT / name for name in ("pyproject.toml", "Cargo.toml", "Cargo.lock", "README.md", *LICENCES)}
    needed |= sources(ROOT / "python")
    for crate in (*CRATES.values(), "crates/pyramap-python"):
        needed |= {ROOT / crate / "Cargo.toml", *sources(ROOT / crate / "src")}
    there = {path.relative_to(unpacked) for path in unpacked.rglob("*") if path.is_file()}
    assert {path.relative_to(ROOT) for path in needed} - there == set()
    assert {path for path in there if path.suffix in (".so", ".pyd", ".pyc")} == set()


def test_the_source_distribution_is_built_of_the_locked_versions(unpacked: Path) -> None:
    """Its workspace has fewer members: cargo must be let prune the lock, and may not choose anew."""
    assert "locked" not in tomllib.loads((unpacked / "pyproject.toml").read_text())["tool"]["maturin"]
    found = cargo_metadata("--manifest-path", unpacked / "Cargo.toml")["packages"]
    locked = {(package["name"], package["version"]) for package in LOCK["package"]}
    chosen = {(package["name"], package["version"]) for package in found}
    assert chosen - locked == set()
    assert {name for name, _ in chosen} >= {*CRATES, "pyramap-python", "wgpu", "pyo3"}


# --- the crates -------------------------------------------------------------------------------------------------------


def test_these_crates_are_published(packages: dict[str, Any]) -> None:
    published = {name for name, package in packages.items() if package["publish"] is None}
    assert published == set(CRATES)


@pytest.mark.parametrize("name", CRATES)
def test_a_crate_says_what_it_is(name: str, packages: dict[str, Any]) -> None:
    package = packages[name]
    assert package["license"] == PROJECT["license"]
    assert len(package["description"].split()) >= 5
    assert package["repository"] == PROJECT["urls"]["Repository"]
    assert package["rust_version"] is not None
    # More than five of either are refused by crates.io.
    assert 1 <= len(package["keywords"]) <= 5
    assert 1 <= len(package["categories"]) <= 5


@pytest.mark.parametrize("name", CRATES)
def test_a_crate_packs_its_sources_licences_and_readme(name: str) -> None:
    folder = ROOT / CRATES[name]
    packed = set(said_by("cargo", "package", "--list", "--allow-dirty", "--locked", "-p", name).splitlines())
    needed = {path.relative_to(folder).as_posix() for path in sources(folder / "src")}
    assert needed | {"Cargo.toml", "README.md", *LICENCES} <= packed
    for licence in LICENCES:
        assert (folder / licence).read_text() == (ROOT / licence).read_text()


def test_the_shaders_are_among_the_sources() -> None:
    files = sources(ROOT / CRATES["pyramap-shaders"] / "src")
    assert sum(path.suffix == ".wgsl" for path in files) > 20


@pytest.mark.parametrize("name", CRATES)
def test_a_crate_needs_published_crates_of_its_own_version(name: str, packages: dict[str, Any]) -> None:
    ours = [dependency for dependency in packages[name]["dependencies"] if "path" in dependency]
    assert len(ours) == {"pyramap": 0, "pyramap-wgpu": 3}.get(name, 1)
    for dependency in ours:
        assert dependency["name"] in CRATES
        assert dependency["req"] == f"^{packages[name]['version']}"


# --- how to cite it ---------------------------------------------------------------------------------------------------


def test_the_citation_names_this_version_and_the_paper(packages: dict[str, Any]) -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["cff-version"] == "1.2.0"
    assert citation["version"] == packages["pyramap"]["version"] == _core.__version__
    assert citation["license"] == PROJECT["license"].split(" OR ")
    assert citation["repository-code"] == PROJECT["urls"]["Repository"]
    (paper,) = citation["references"]
    readme = re.sub(r"\s+", " ", (ROOT / "README.md").read_text())
    *first, last = (author["family-names"] for author in paper["authors"])
    assert f"{', '.join(first)} and {last}, *{paper['title']}* ({paper['year']})" in readme
