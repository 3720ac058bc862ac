"""The audit of a console whose state directory takes no file at the start, and takes one later."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest

from lockstep.server.audit import audit_writer
from lockstep.server.audit.audit_file import stored_records
from lockstep.server.audit.audit_log import open_audit_log
from lockstep.server.audit.records import AuditRecord, AuditTrouble
from lockstep.server.cli.access.audit import verify_audit
from lockstep.server.evidence.signer import evidence_signer
from lockstep.server.settings import Settings
from lockstep.server.util.state_dir import StateDir
from tests.server.rig import PATIENCE, eventually


def _record(n: int) -> AuditRecord:
    return AuditRecord(n=n, time=1.0, kind="stop")


async def _said(wanted: list[str], said: list[str]) -> None:
    async with asyncio.timeout(PATIENCE):
        await eventually(lambda: said == wanted)


async def test_an_audit_that_had_no_place_at_the_start_is_written_behind_what_is_there_as_soon_as_it_has_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make: Callable[..., audit_writer.AuditWriter] = audit_writer.AuditWriter
    monkeypatch.setattr("lockstep.server.audit.audit_log.AuditWriter", lambda file, told: make(file, told, 0.01))
    directory, settings = StateDir(tmp_path), Settings(state_dir=tmp_path)
    signer = evidence_signer(directory)
    with open_audit_log(directory, settings, signer=signer) as audit:
        for n in (1, 2, 3):
            audit.append(_record(n))
    (tmp_path / "audit.lock").unlink()
    (tmp_path / "audit.lock").mkdir()  # nothing opens it for writing
    said: list[str] = []

    def hear(event: AuditRecord | AuditTrouble) -> None:
        if isinstance(event, AuditTrouble):
            said.append(event.trouble)

    with open_audit_log(directory, settings, signer=signer, publish=hear) as audit:
        audit.append(_record(1))
        await _said(["Is a directory"], said)
        audit.append(_record(2))
        (tmp_path / "audit.lock").rmdir()
        await _said(["Is a directory", ""], said)
        audit.append(_record(3))
    path = tmp_path / "audit.jsonl"
    assert [record.n for record in stored_records(path)] == [1, 2, 3, 4, 5, 6]
    anchors = Path(settings.recording.directory or tmp_path / "recordings") / "audit-anchors.jsonl"
    assert verify_audit(path, "", anchors, signer.public_key).ok
    with directory.own_log("audit") as again:
        assert again == path, "the lock was let go"
