"""The backup of docs/deploy.md, with the folders as systemd makes them."""

import re
import shlex
import subprocess
from pathlib import Path

import pytest
import yaml

DEPLOY = Path(__file__).parents[2] / "docs" / "deploy.md"
UNITS = Path(__file__).parents[2] / "deploy" / "systemd"
COMPOSE = [yaml.safe_load(path.read_text()) for path in Path(__file__).parents[2].glob("*compose*.y*ml")]


def _rows() -> dict[str, list[str]]:
    """The row of the table of backups for each volume of Compose."""
    section = DEPLOY.read_text().partition("## Backup")[2].partition("\n## ")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in section.splitlines() if line[:1] == "|"]
    return {name: row for row in rows for name in re.findall("`([a-z-]+)`", row[2].partition("volume")[2])}


def _commands() -> dict[str, str]:
    """The command that backs up each volume of Compose."""
    found = re.findall(r"^(docker compose run .*?) *# Compose: (\S+)$", DEPLOY.read_text(), re.M)
    return {volume: command for command, volume in found}


def test_the_table_has_every_volume_of_compose_and_no_other() -> None:
    assert COMPOSE
    assert sorted(_rows()) == sorted(name for each in COMPOSE for name in each["volumes"])


def test_every_volume_has_a_command_or_a_reason_to_have_none() -> None:
    rows = _rows()
    without = {name for name, row in rows.items() if row[4].startswith("none") or row[3].startswith("nothing")}
    assert without | set(_commands()) == set(rows)
    assert without & set(_commands()) == set()


@pytest.mark.parametrize("volume", _commands())
def test_the_command_reads_the_folder_where_its_service_has_the_volume(volume: str) -> None:
    words = shlex.split(_commands()[volume].partition(" > ")[0])
    at = words.index("tar")
    assert words[at - 1 :][:3:2] == ["--entrypoint", words[at + 1]]
    service, options = words[at + 1], words[at + 2 :]
    (place,) = [
        each.split(":")[1]
        for compose in COMPOSE
        for each in compose["services"][service]["volumes"]
        if isinstance(each, str) and each.startswith(f"{volume}:")
    ]
    assert options[0] == "-C"
    assert Path(options[1]) / options[-1] == Path(place)


def test_the_backup_holds_the_files_behind_the_link_that_a_dynamic_user_gets(tmp_path: Path) -> None:
    """systemd.exec(5), DynamicUser=: the state directory is in /var/lib/private, and /var/lib has a link to it."""
    assert "DynamicUser=yes" in (UNITS / "lockstep-console.service").read_text()
    (line,) = re.findall(r"^sudo (tar .*?) *# systemd$", DEPLOY.read_text(), re.M)
    private = tmp_path / "var" / "private" / "lockstep"
    private.mkdir(parents=True)
    (private / "audit.jsonl").write_text("{}\n")
    (tmp_path / "var" / "lockstep").symlink_to("private/lockstep")
    command = line.replace("/var/lib", str(tmp_path / "var"))
    subprocess.run(command, shell=True, check=True, cwd=tmp_path)
    (archive,) = tmp_path.glob("*.tar.gz")
    listed = subprocess.run(["tar", "-tzf", archive], check=True, capture_output=True, text=True).stdout
    assert "./audit.jsonl" in listed.splitlines()

    (private / "audit.jsonl").unlink()
    (restore,) = re.findall(r"`sudo (tar -xzf FILE -C /var/lib/lockstep)`", DEPLOY.read_text())
    command = restore.replace("FILE", str(archive)).replace("/var/lib", str(tmp_path / "var"))
    subprocess.run(command, shell=True, check=True, cwd=tmp_path)
    assert (private / "audit.jsonl").read_text() == "{}\n"
