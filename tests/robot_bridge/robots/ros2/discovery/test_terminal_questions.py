"""Questions at the terminal: an answer out of range is asked for again."""

import typer
from typer.testing import CliRunner

from lockstep.robot_bridge.robots.ros2.discovery.terminal_questions import AskAtTerminal

app = typer.Typer()


@app.command()
def ask() -> None:
    person = AskAtTerminal()
    typer.echo(f"chose {person.choose('Which topic?', ['/a', '/b'])}")
    typer.echo(f"took {person.number('Fastest, m/s', 0.2, 0.001, 20.0)}")
    typer.echo(f"agreed {person.agree('Sideways?', False)}")


def answered(*lines: str) -> str:
    done = CliRunner().invoke(app, input="".join(f"{line}\n" for line in lines))
    assert done.exit_code == 0, done.output
    return done.output


def test_an_empty_line_takes_the_default() -> None:
    said = answered("", "", "")
    assert "chose 0" in said
    assert "took 0.2" in said
    assert "agreed False" in said
    assert "  2  /b" in said


def test_what_cannot_be_meant_is_asked_again() -> None:
    said = answered("3", "2", "fast", "nan", "-1", "0.7", "y")
    assert "It must be from 1 to 2." in said
    assert said.count("It must be from 0.001 to 20.") == 2
    assert "chose 1" in said
    assert "took 0.7" in said
    assert "agreed True" in said
