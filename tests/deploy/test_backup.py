"""The backup of docs/deploy.md, with the folders as systemd makes them."""

import re
import subprocess
from pathlib import Path

DEPLOY = Path(__file__).parents[2] / "docs" / "deploy.md"
UNITS = Path(__file__).parents[2] / "deploy" / "systemd"


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
