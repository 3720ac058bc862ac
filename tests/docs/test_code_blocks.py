"""Code in the documents can be read by what it is meant for, and its `lockstep` commands and options exist.

The tutorials' commands and programs are also run, by tests/docs/tutorials/; examples of other pages mostly need a
robot, a network or a public address that no test has.
"""

import ast
import json
import re
import subprocess
import textwrap
import tomllib
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import typer.main
import yaml

from lockstep.client.lead.cli import arguments
from lockstep.server.cli.main import app
from lockstep.server.cli.measurements import COMMANDS

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^( *)```(\w*)\n(.*?)\n *```$", re.MULTILINE | re.DOTALL)
WORDS = re.compile(r"(?:^|(?<=[\s`'/]))lockstep ((?:[a-z-]+|--)[^`#|;&)\n]*)", re.MULTILINE)
HASHED = ("recording chain", "recording signature")  # texts that are hashed and signed, no commands
LEROBOTS = ("--robot.", "--teleop.")  # flags of LeRobot, which the command hands on
LANGUAGES = {"sh", "console", "python", "toml", "yaml", "json", "text", "hex", "mermaid", ""}


class Block(NamedTuple):
    page: str
    line: int
    language: str
    text: str


def blocks() -> Iterator[Block]:
    for page in PAGES:
        text = page.read_text()
        for found in BLOCK.finditer(text):
            line = text.count("\n", 0, found.start()) + 1
            yield Block(str(page.relative_to(ROOT)), line, found[2], textwrap.dedent(found[1] + found[3]))


ALL = list(blocks())


def of(*languages: str) -> pytest.MarkDecorator:
    chosen = [block for block in ALL if block.language in languages]
    return pytest.mark.parametrize("block", chosen, ids=lambda block: f"{block.page}:{block.line}")


def test_there_are_blocks_and_each_is_of_a_known_language() -> None:
    assert len(ALL) > 60
    assert [block for block in ALL if block.language not in LANGUAGES] == []


@of("python")
def test_python_compiles(block: Block) -> None:
    ast.parse(block.text)


@of("sh")
def test_bash_can_read_the_commands(block: Block) -> None:
    checked = subprocess.run(["bash", "-n"], input=block.text, capture_output=True, text=True, check=False)
    assert (checked.returncode, checked.stderr) == (0, "")


@of("toml")
def test_toml_is_valid(block: Block) -> None:
    tomllib.loads(block.text)


@of("yaml")
def test_yaml_is_valid(block: Block) -> None:
    yaml.safe_load(block.text)


@of("json")
def test_json_is_valid(block: Block) -> None:
    for line in block.text.splitlines() if block.text.count("\n{") else [block.text]:  # one message a line
        json.loads(line)


# Commands


def commands(text: str) -> list[list[str]]:
    """The words behind each `lockstep` in code. Lines that end in a backslash are one, and a quotation is one word."""
    code = [block for _, _, block in BLOCK.findall(text)] + re.findall(r"`([^`\n]+)`", BLOCK.sub("", text))
    plain = (re.sub(r"'[^'\n]*'|\"[^\"\n]*\"", "QUOTED", re.sub(r"\\\n\s*", " ", each)) for each in code)
    return [words.split() for each in plain for words in WORDS.findall(each) if not words.startswith(HASHED)]


def flaws(words: list[str]) -> Iterator[str]:
    command: Any = typer.main.get_command(app)
    for word in words:
        name = word.partition("=")[0].rstrip("],")
        if name.startswith(LEROBOTS):
            continue
        if name.startswith("--"):
            if name not in _options(command):
                yield f"lockstep {' '.join(words)}: no {name}"
        elif hasattr(command, "get_command"):
            inner = _inner(command, word)
            if inner is None and command.name != "robot":  # whose argument is a robot's name
                yield f"lockstep {' '.join(words)}: no command {word}"
                return
            command = command if inner is None else inner


def _inner(group: Any, name: str) -> Any:
    """Measurements have parsers of their own, which the command hands its words to."""
    if name not in COMMANDS:
        return group.get_command(None, name)
    module, function, _ = COMMANDS[name]
    own = typer.Typer()
    own.command()(getattr(import_module(module), function))
    return typer.main.get_command(own)


def _options(command: Any) -> set[str]:
    if command.name == "drive":  # which has a parser of its own
        return set(re.findall(r"--[a-z-]+", arguments("lockstep drive").format_help()))
    given = {name for each in command.params for name in (*each.opts, *each.secondary_opts)}
    return given | {"--help", "--version"}


@pytest.mark.slow  # loads the code of every command
@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_lockstep_command_and_option_exists(page: Path) -> None:
    assert [flaw for words in commands(page.read_text()) for flaw in flaws(words)] == []


def test_a_command_or_option_that_does_not_exist_is_named() -> None:
    text = "`lockstep fly`, `lockstep up --colour red`\n```sh\nlockstep serve \\\n  --robot tcp://a:1 --fast\n```\n"
    found = [flaw for words in commands(text) for flaw in flaws(words)]
    assert [flaw.rpartition("no ")[2] for flaw in found] == ["--fast", "command fly", "--colour"]
