"""docs/client.md shows every public name of `lockstep.client`, and each has a docstring to show."""

import ast
import inspect
import re
import textwrap
from importlib import import_module
from pathlib import Path

import pytest

from lockstep import client
from lockstep.client import force_feedback

TEXT = (Path(__file__).resolve().parents[2] / "docs" / "client.md").read_text()
SHOWN = re.findall(r"^::: (lockstep\.[\w.]+)$", TEXT, re.MULTILINE)
OWN = sorted(client.__all__)
OPTIONAL = [f"force_feedback.{name}" for name in force_feedback.__all__]


def test_every_public_name_is_shown_once() -> None:
    assert sorted(name.removeprefix("lockstep.client.") for name in SHOWN if "client" in name) == sorted(OWN + OPTIONAL)


@pytest.mark.parametrize("name", OWN)
def test_every_public_name_says_what_it_is(name: str) -> None:
    assert inspect.getdoc(getattr(client, name))


@pytest.mark.parametrize("name", [name for name in vars(client.Console) if not name.startswith("_")])
def test_every_public_member_of_the_console_says_what_it_does_and_names_its_parameters(name: str) -> None:
    member = vars(client.Console)[name]
    text = inspect.getdoc(member)
    assert text
    if inspect.isfunction(member):
        for parameter in list(inspect.signature(member).parameters)[1:]:
            assert re.search(rf"^    {parameter}: |`{parameter}`", text, re.MULTILINE), parameter


@pytest.mark.parametrize("name", SHOWN)
def test_every_field_of_what_it_hands_out_says_what_it_is(name: str) -> None:
    module, _, kind = name.rpartition(".")
    shown = getattr(import_module(module), kind)
    source = textwrap.dedent(inspect.getsource(shown))
    lines = source.splitlines()
    tree = ast.parse(source).body[0]
    assert isinstance(tree, ast.ClassDef)
    fields = [each for each in tree.body if isinstance(each, ast.AnnAssign)]
    assert [ast.unparse(each) for each in fields if "# " not in lines[(each.end_lineno or 0) - 1]] == []


def test_the_constructors_parameters_are_all_explained() -> None:
    text = inspect.getdoc(client.Console) or ""
    for parameter in list(inspect.signature(client.Console).parameters):
        assert re.search(rf"^    {parameter}: ", text, re.MULTILINE), parameter
