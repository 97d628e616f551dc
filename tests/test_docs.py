"""Every public name says what it is, and every function what its arguments are; the pages name all of them."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pyramap as pm
import pytest

MODULES = (pm, pm.datasets, pm.scenes)


def public_things() -> Iterator[tuple[str, object]]:
    for module in MODULES:
        yield module.__name__, module
        for name in module.__all__:
            thing = getattr(module, name)
            if isinstance(thing, ModuleType | str):
                continue
            yield f"{module.__name__}.{name}", thing
            if inspect.isclass(thing):
                for member, value in inspect.getmembers(thing, is_method_or_property):
                    if not member.startswith("_") and not is_inherited(thing, member):
                        yield f"{module.__name__}.{name}.{member}", value


def is_method_or_property(member: object) -> bool:
    """And no field of a data class: those stand in the docstring of the class."""
    return inspect.isroutine(member) or isinstance(member, property) or inspect.isgetsetdescriptor(member)


def is_inherited(cls: type, member: str) -> bool:
    """Whether a member comes from a class of another package, which documents it."""
    owner = next(base for base in cls.__mro__ if member in vars(base))
    return not owner.__module__.startswith("pyramap")


THINGS = dict(public_things())


def test_all_of_it_is_looked_at() -> None:
    expected = {"OccupancyGrid.integrate", "OccupancyGrid.bounds", "pyramid", "scenes.box", "datasets.open"}
    assert {f"pyramap.{name}" for name in expected} <= set(THINGS)


@pytest.mark.parametrize("name", THINGS)
def test_every_public_name_has_a_docstring(name: str) -> None:
    doc = inspect.getdoc(THINGS[name])
    assert doc is not None, "no docstring"
    first = doc.split("\n\n")[0]
    assert len(first.split()) >= 3, first
    assert first.rstrip()[-1] in ".:", f"the first paragraph is no sentence: {first!r}"


def parameters(thing: object) -> list[str]:
    if not callable(thing):
        return []
    try:
        signature = inspect.signature(thing)
    except ValueError:  # an exception, or a class that only the library makes
        return []
    return [name for name in signature.parameters if name not in ("self", "args", "kwargs")]


NOT_MADE_BY_USERS = {"pyramap.scenes.SceneFrames"}
WITH_PARAMETERS = [
    name
    for name, thing in THINGS.items()
    if parameters(thing) and not name.startswith("pyramap.datasets") and name not in NOT_MADE_BY_USERS
]


@pytest.mark.parametrize("name", WITH_PARAMETERS)
def test_every_argument_is_explained(name: str) -> None:
    doc = inspect.getdoc(THINGS[name]) or ""
    assert [parameter for parameter in parameters(THINGS[name]) if f"\n    {parameter}: " not in doc] == []


REFERENCE = "".join(page.read_text() for page in (Path(__file__).parents[1] / "docs/api").glob("*.md"))
LISTED = {
    (kind, name.removeprefix("pyramap."))
    for kind, name in re.findall(r"^\.\. (?:auto|py:)(\w+):: (\S+)$", REFERENCE, re.MULTILINE)
}
WITH_MEMBERS = set(re.findall(r"^\.\. auto\w+:: pyramap\.(\S+)\n   :members:$", REFERENCE, re.MULTILINE))


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__)
def test_every_public_name_is_on_a_page(module: ModuleType) -> None:
    prefix = module.__name__.removeprefix("pyramap").lstrip(".")
    names = [f"{prefix}.{name}".lstrip(".") for name in module.__all__]
    assert sorted(set(names) - {name for _, name in LISTED}) == []


@pytest.mark.parametrize("name", [name for name, thing in THINGS.items() if "." in name and inspect.isclass(thing)])
def test_every_member_is_on_a_page(name: str) -> None:
    members = {other.removeprefix("pyramap.") for other in THINGS if other.startswith(f"{name}.")}
    listed = {name for _, name in LISTED}
    assert name.removeprefix("pyramap.") in WITH_MEMBERS or sorted(members - listed) == []


def test_what_is_on_a_page_exists() -> None:
    for kind, name in LISTED - {("module", "datasets"), ("module", "scenes"), ("module", "pictures")}:
        thing: object = pm
        for part in name.split("."):
            thing = getattr(thing, part)
        assert inspect.isclass(thing) == (kind in ("class", "exception")), name
