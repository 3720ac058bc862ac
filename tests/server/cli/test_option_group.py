from dataclasses import dataclass
from typing import Annotated

import typer
from typer.testing import CliRunner

from lockstep.server.cli.option_group import with_options


@dataclass(frozen=True)
class _Shared:
    port: Annotated[int, typer.Option(help="Port.")] = 8000
    quiet: Annotated[bool, typer.Option("--quiet", help="Less.")] = False


def test_a_command_takes_the_options_of_a_group_after_its_own_with_their_defaults_and_types() -> None:
    app, taken = typer.Typer(), list[tuple[str, _Shared]]()

    @app.command()
    @with_options(_Shared)
    def run(robot: Annotated[str, typer.Option(help="Robot.")] = "planar", *, options: _Shared) -> None:
        taken.append((robot, options))

    runner = CliRunner()
    assert runner.invoke(app, []).exit_code == 0
    assert runner.invoke(app, ["--quiet", "--robot", "arm", "--port", "9000"]).exit_code == 0
    assert taken == [("planar", _Shared()), ("arm", _Shared(9000, True))]
    assert runner.invoke(app, ["--port", "no number"]).exit_code == 2
    told = runner.invoke(app, ["--help"]).output
    assert told.index("--robot") < told.index("--port") < told.index("--quiet")
    assert "--options" not in told
