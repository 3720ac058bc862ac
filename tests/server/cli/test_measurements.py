from importlib import import_module

import pytest
from typer.testing import CliRunner

from lockstep.server.cli.main import app
from lockstep.server.cli.measurements import COMMANDS


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_that_is_listed_is_there_and_explains_itself(name: str) -> None:
    module, function, about = COMMANDS[name]
    assert callable(getattr(import_module(module), function))
    assert about in CliRunner().invoke(app, ["--help"], terminal_width=200).output
    asked = CliRunner().invoke(app, [name, "--help"], terminal_width=200)
    assert asked.exit_code == 0
    assert {"interoperability": "--way", "soak-day": "--minutes"}.get(name, "--seed") in asked.output
