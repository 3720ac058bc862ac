"""The command, with clients that need no browser, each for a few seconds."""

import json
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from lockstep.bench.interoperability.cli import interoperability_command
from lockstep.emulator.errors import NamespacesUnavailable
from lockstep.emulator.namespace.namespaces import ROBOT_ADDRESS
from lockstep.emulator.namespace.tun import open_tun

SIX_SECONDS = "0.1"  # of a minute


@pytest.fixture
def command() -> typer.Typer:
    app = typer.Typer()
    app.command()(interoperability_command)
    return app


def _needs_namespaces() -> None:
    try:
        open_tun(ROBOT_ADDRESS).close()
    except NamespacesUnavailable as reason:
        pytest.skip(str(reason))


@pytest.mark.parametrize(("client", "way"), [("headless", "turn"), ("aiortc", "nat"), ("headless", "two")])
def test_a_cell_is_run_kept_and_not_run_again(command: typer.Typer, tmp_path: Path, client: str, way: str) -> None:
    _needs_namespaces()
    results = tmp_path / "results.json"
    asked = [str(results), "--client", client, "--way", way, "--scale", SIX_SECONDS]
    done = CliRunner().invoke(command, asked)
    assert done.exit_code == 0, done.output
    found = json.loads(results.read_text())[f"{client} {way}"]
    assert found["pictures"] > 12
    written = results.stat().st_mtime_ns
    again = CliRunner().invoke(command, asked)
    assert (again.exit_code, results.stat().st_mtime_ns) == (0, written)
    assert f"ok (6 s, {found['pictures']} pictures)" in again.output


def test_a_client_or_way_that_there_is_not_is_said_to_be_none(command: typer.Typer, tmp_path: Path) -> None:
    done = CliRunner().invoke(command, [str(tmp_path / "x.json"), "--client", "netscape"])
    assert done.exit_code == 2
    assert "no netscape; there are chromium" in done.output


def test_a_file_that_is_no_table_is_left_alone(command: typer.Typer, tmp_path: Path) -> None:
    other = tmp_path / "other.json"
    other.write_text("[1]")
    done = CliRunner().invoke(command, [str(other)])
    assert done.exit_code == 2
    assert "cannot be read" in done.output
    assert other.read_text() == "[1]"
