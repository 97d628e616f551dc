"""The workflows of CI and releases can run: what they name exists, and what they may do is little."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / ".github/workflows"
WORKFLOWS: dict[str, Any] = {path.name: yaml.safe_load(path.read_text()) for path in sorted(FOLDER.iterdir())}
JOBS = [(file, name) for file, workflow in WORKFLOWS.items() for name in workflow["jobs"]]


def steps(job: Any) -> list[Any]:
    return list(job.get("steps", []))


def commands(workflow: Any) -> str:
    return "\n".join(step["run"] for job in workflow["jobs"].values() for step in steps(job) if "run" in step)


def strings(value: Any) -> Iterator[str]:
    """All text in a job, however deep."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        for part in value:
            yield from strings(part)
    elif isinstance(value, str):
        yield value


def test_there_is_one_for_each_purpose() -> None:
    assert set(WORKFLOWS) == {"ci.yml", "docs.yml", "release.yml", "wheels.yml"}


@pytest.mark.parametrize(("file", "name"), JOBS)
def test_a_job_names_what_there_is(file: str, name: str) -> None:
    jobs = WORKFLOWS[file]["jobs"]
    job = jobs[name]
    needs = job.get("needs", [])
    assert set([needs] if isinstance(needs, str) else needs) <= jobs.keys() - {name}
    # Actions of others are pinned to a major version.
    for action in [job["uses"]] if "uses" in job else [step["uses"] for step in steps(job) if "uses" in step]:
        if action.startswith("./"):
            assert (ROOT / action).is_file()
            assert "workflow_call" in triggers(WORKFLOWS[Path(action).name])
        else:
            assert re.fullmatch(r"[\w-]+/[\w-]+@(release/)?v\d+", action), action
    matrix = job.get("strategy", {}).get("matrix", {})
    variables = set(matrix).union(*matrix.get("include", []))
    used = {variable for text in strings(job) for variable in re.findall(r"\bmatrix\.([\w-]+)", text)}
    assert used <= variables
    ids = {step["id"] for step in steps(job) if "id" in step}
    assert {step for text in strings(job) for step in re.findall(r"\bsteps\.([\w-]+)", text)} <= ids
    assert "uses" in job or "timeout-minutes" in job


def triggers(workflow: Any) -> Any:
    """What starts a workflow: YAML takes the key `on` for a truth value."""
    return workflow[True]


@pytest.mark.parametrize("file", WORKFLOWS)
def test_their_commands_exist(file: str) -> None:
    targets = set(re.findall(r"^([\w-]+):(?!=)", (ROOT / "Makefile").read_text(), re.MULTILINE))
    text = commands(WORKFLOWS[file])
    assert set(re.findall(r"^make ([\w-]+)", text, re.MULTILINE)) <= targets
    assert all((ROOT / script).is_file() for script in re.findall(r"^bash (\S+)", text, re.MULTILINE))


@pytest.mark.parametrize(("file", "name"), JOBS)
def test_only_what_publishes_may_write(file: str, name: str) -> None:
    assert WORKFLOWS[file]["permissions"] == {"contents": "read"}
    may = {
        ("release.yml", "pypi"): {"id-token": "write"},
        ("release.yml", "crates"): {"contents": "read", "id-token": "write"},
        ("docs.yml", "deploy"): {"pages": "write", "id-token": "write"},
    }
    assert WORKFLOWS[file]["jobs"][name].get("permissions") == may.get((file, name))
    assert "secrets." not in (FOLDER / file).read_text()


def test_a_release_is_a_tag_and_nothing_is_published_untested() -> None:
    release = WORKFLOWS["release.yml"]
    assert triggers(release) == {"push": {"tags": ["v*"]}}
    jobs = release["jobs"]
    assert set(jobs["pypi"]["needs"]) == set(jobs["crates"]["needs"]) == {"test", "wheels"}
    assert jobs["test"]["needs"] == jobs["wheels"]["needs"] == "version"
    # Whoever may publish is known to the registries by these.
    assert {jobs["pypi"]["environment"], jobs["crates"]["environment"]} == {"pypi", "crates-io"}
    assert "cargo publish --workspace" in commands(release)


def test_wheels_for_every_system_are_built_and_tried() -> None:
    (job,) = WORKFLOWS["wheels.yml"]["jobs"].values()
    built = {system["name"]: system.get("options", "") for system in job["strategy"]["matrix"]["include"]}
    assert set(built) == {"linux-x86_64", "linux-aarch64", "macos-x86_64", "macos-arm64", "windows-x86_64"}
    assert all(("--zig" in options) == name.startswith("linux") for name, options in built.items())
    text = commands(WORKFLOWS["wheels.yml"])
    assert text.index("maturin build") < text.index("dist/*.whl") < text.index("pyramap demo")
    (wanted,) = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]
    assert f'"{wanted.replace("maturin", "maturin[zig]")}"' in text


def test_the_documentation_is_taken_from_where_it_is_built() -> None:
    (path,) = (
        step["with"]["path"] for step in steps(WORKFLOWS["docs.yml"]["jobs"]["build"]) if "path" in step.get("with", {})
    )
    assert re.search(rf"sphinx .* {re.escape(path)}$", (ROOT / "Makefile").read_text(), re.MULTILINE)
