"""The audit on disk: two files with a chain each, and signed heads in a second place."""

import os
from itertools import count
from pathlib import Path

import msgspec
import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from lockstep.server.audit import audit_store
from lockstep.server.audit.audit_file import chatter_path, rotated, stored_records
from lockstep.server.audit.audit_store import AuditStore
from lockstep.server.audit.records import AuditKind, AuditRecord
from lockstep.server.cli.access.audit import AuditVerdict, verify_audit
from lockstep.server.evidence.anchors import Anchor, AnchorFile, anchor_text, parse_anchor, sign_anchor
from lockstep.server.evidence.signer import Signer


class Made:
    """A store, its numbers and its key."""

    def __init__(self, directory: Path, max_bytes: int = 100_000, files: int = 3) -> None:
        self.path = directory / "audit.jsonl"
        self.anchors = directory / "elsewhere" / "audit-anchors.jsonl"
        self.signer = Signer(Ed25519PrivateKey.generate())
        self._numbers = count(1)
        self._sizes = max_bytes, files
        self.store = self.again()

    def again(self) -> AuditStore:
        self.store = AuditStore(self.path, *self._sizes, signer=self.signer, anchors=AnchorFile(self.anchors, 100_000))
        return self.store

    def write(self, *kinds: AuditKind) -> None:
        self.store.write([AuditRecord(n=next(self._numbers), time=1.0, kind=kind, detail="x" * 40) for kind in kinds])

    def verdict(self) -> AuditVerdict:
        return verify_audit(self.path, "", self.anchors, self.signer.public_key)


def _edit(path: Path, line: int, old: bytes, new: bytes) -> None:
    lines = path.read_bytes().split(b"\n")
    assert old in lines[line]
    lines[line] = lines[line].replace(old, new)
    path.write_bytes(b"\n".join(lines))


def test_what_counts_and_chatter_are_kept_apart_and_read_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    made = Made(tmp_path)
    made.write("start", "joined", "seat", "refusal", "stop")
    made.store.close()
    assert [record.n for record in stored_records(made.path)] == [1, 2, 3, 4, 5]
    assert len(made.path.read_bytes().splitlines()) == 3
    assert len(chatter_path(made.path).read_bytes().splitlines()) == 2
    assert made.verdict().ok


def test_a_flood_of_chatter_rotates_its_own_files_alone(tmp_path: Path) -> None:
    made = Made(tmp_path, max_bytes=4096, files=2)
    made.write("start", "stop", "invitation")
    for _ in range(200):
        made.write("renamed", "joined", "left", "refusal", "note")
    made.store.close()
    assert rotated(chatter_path(made.path), 1).exists()
    assert not rotated(made.path, 1).exists()
    kept = list(stored_records(made.path))
    assert [record.kind for record in kept[:3]] == ["start", "stop", "invitation"]
    verdict = made.verdict()
    assert verdict.ok
    assert verdict.chatter.earlier


def test_a_write_that_failed_in_the_second_file_is_not_written_twice_in_the_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = Made(tmp_path)
    records = [AuditRecord(n=1, time=1.0, kind="stop"), AuditRecord(n=2, time=1.0, kind="note")]
    chatter_path(made.path).mkdir()
    with pytest.raises(OSError, match="directory"):
        made.store.write(records)
    chatter_path(made.path).rmdir()
    made.store.write(records)
    made.store.close()
    assert [record.n for record in stored_records(made.path)] == [1, 2]
    assert made.verdict().ok


def test_heads_are_signed_at_the_first_record_at_intervals_and_at_the_end_and_not_when_nothing_came(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = Made(tmp_path)
    made.write("start")
    made.store.settle()
    made.write("stop")
    made.store.settle()
    assert len(made.anchors.read_bytes().splitlines()) == 1, "the interval is not over"
    monkeypatch.setattr(audit_store, "ANCHOR_SECONDS", 0.0)
    made.store.settle()
    made.store.settle()
    assert len(made.anchors.read_bytes().splitlines()) == 2
    made.write("reset")
    made.store.close()
    assert len(made.anchors.read_bytes().splitlines()) == 3
    made.again().close()
    assert made.verdict().anchors.fitting == 4, "a run without a record signs what it found"
    newest = made.verdict().anchors.newest
    assert newest is not None
    assert (newest.n, newest.key) == (3, made.signer.public_key)


def test_a_tail_that_was_cut_off_a_last_record_that_was_changed_and_a_chain_that_was_made_anew_are_found(
    tmp_path: Path,
) -> None:
    made = Made(tmp_path)
    made.write("start", "seat", "stop", "note")
    made.store.close()
    whole = made.path.read_bytes()
    made.path.write_bytes(b"".join(whole.splitlines(keepends=True)[:2]))
    assert [fault.kind for fault in made.verdict().own.faults] == ["cut"]
    made.path.write_bytes(whole)
    _edit(made.path, 2, b'"stop"', b'"seat"')
    assert [fault.kind for fault in made.verdict().own.faults] == ["anchor"]
    made.path.unlink()
    forged = AuditStore(made.path, 100_000, 3)
    forged.write([AuditRecord(n=n, time=1.0, kind="seat") for n in (1, 2, 3)])
    forged.close()
    verdict = made.verdict()
    assert verdict.own.faults[0].kind == "anchor", "its chain fits, what was signed does not"
    chatter_path(made.path).unlink()
    assert made.verdict().chatter.faults[0].kind == "cut"


def test_a_signed_record_that_was_taken_out_is_missed_though_the_chain_was_made_anew_around_it(tmp_path: Path) -> None:
    made = Made(tmp_path)
    made.write("start", "seat", "stop")
    made.store.close()
    made.path.unlink()
    forged = AuditStore(made.path, 100_000, 3)
    forged.write([AuditRecord(n=n, time=1.0, kind="seat") for n in (1, 2, 4)])
    forged.close()
    assert [fault.kind for fault in made.verdict().own.faults] == ["cut"]


def test_a_signature_for_something_else_is_none_for_a_head() -> None:
    signer = Signer(Ed25519PrivateKey.generate())
    head = Anchor(log="audit", n=1, head="0", chatter_n=0, chatter_head="0", time=1.0, key=signer.public_key)
    assert parse_anchor(anchor_text(sign_anchor(head, signer))) is not None
    forged = msgspec.structs.replace(head, signature=signer.sign(msgspec.json.encode(head)))
    assert parse_anchor(anchor_text(forged)) is None


def test_heads_of_another_key_of_another_audit_and_with_a_changed_text_say_nothing(tmp_path: Path) -> None:
    made = Made(tmp_path)
    made.write("start")
    made.store.close()
    stranger = Made(tmp_path / "stranger")
    stranger.path.parent.mkdir()
    stranger.anchors = made.anchors
    stranger.again()
    stranger.write("start", "stop", "seat")
    stranger.store.close()
    left = AuditStore(made.path, 100_000, 3, "left", made.signer, AnchorFile(made.anchors, 100_000))
    left.close()
    found = made.verdict().anchors
    assert (found.known, found.fitting, found.other_keys) == (2, 1, 1)
    made.anchors.write_bytes(made.anchors.read_bytes().replace(b'"n":1,', b'"n":2,'))
    assert made.verdict().anchors.known == 1, "a changed one is not signed"


def test_a_second_place_that_cannot_be_written_stops_nothing(tmp_path: Path) -> None:
    made = Made(tmp_path)
    made.anchors.parent.write_text("no folder")
    made.write("start")
    made.store.settle()
    made.write("stop")
    made.store.close()
    assert [record.n for record in stored_records(made.path)] == [1, 2]
    made.anchors.parent.unlink()
    verdict = made.verdict()
    assert verdict.ok
    assert verdict.anchors.newest is None


def test_a_head_that_a_full_disk_took_half_of_is_signed_again_and_spoils_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = Made(tmp_path)
    made.write("start")
    made.store.settle()
    made.write("stop")
    real = os.write
    with monkeypatch.context() as disk:
        disk.setattr(audit_store, "ANCHOR_SECONDS", 0.0)
        disk.setattr("lockstep.server.evidence.anchors.os.write", lambda handle, data: real(handle, data[:20]))
        made.store.settle()
    assert made.verdict().anchors.known == 1
    made.store.close()
    found = made.verdict().anchors
    assert (found.known, found.fitting) == (2, 2)
    assert found.newest is not None
    assert found.newest.n == 2
