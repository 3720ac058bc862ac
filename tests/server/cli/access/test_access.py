"""`lockstep invite`, `invitations`, `revoke` and `audit`, beside a running console and without one."""

import asyncio
import json
import os
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from lockstep.client import Console, ConsoleLost, SignallingRefused
from lockstep.server.audit.audit_file import AuditFile
from lockstep.server.audit.audit_log import anchors_path
from lockstep.server.audit.audit_store import AuditStore
from lockstep.server.audit.records import AuditRecord
from lockstep.server.auth.tokens import Identity
from lockstep.server.cli.main import app
from lockstep.server.errors import LinkRevoked
from lockstep.server.evidence.anchors import AnchorFile
from lockstep.server.settings import Settings
from lockstep.server.state.persistent_state import open_state
from lockstep.server.util.state_dir import StateDir, StateDirUnusable
from tests.support.stack import running_stack
from tests.waiting import PATIENCE

LOCKSTEP = str(Path(sys.executable).with_name("lockstep"))


def _lockstep(directory: Path, *arguments: str) -> Result:
    """The command in this process, with a state directory of its own."""
    environment = {"LOCKSTEP_STATE_DIR": str(directory), "LOCKSTEP_PUBLIC_URL": ""}
    return CliRunner().invoke(app, arguments, env=environment)


def _identity(directory: Path, link: str) -> Identity:
    return open_state(Settings(state_dir=directory)).access.verify(link.strip().partition("#token=")[2])


def test_on_a_full_disk_a_link_is_revoked_all_the_same_and_nobody_is_invited(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = _lockstep(tmp_path, "invite", "--url", "http://x").stdout.strip()
    link = open_state(Settings(state_dir=tmp_path)).access.verify(made.partition("#token=")[2]).token_id

    def full(*_: object) -> None:
        raise StateDirUnusable(tmp_path, "No space left on device")

    with monkeypatch.context() as disk:
        disk.setattr(StateDir, "write", full)
        nothing_aside = _lockstep(tmp_path, "revoke", link)
        assert (nothing_aside.exit_code, "No space left" in nothing_aside.stderr) == (2, True)
    open_state(Settings(state_dir=tmp_path)).invitations.keep_time()  # as a console does that runs
    with monkeypatch.context() as disk:
        disk.setattr(StateDir, "write", full)
        noted = _lockstep(tmp_path, "revoke", link)
        assert (noted.exit_code, "No space left" in noted.stderr) == (0, True)
        refused = _lockstep(tmp_path, "invite", "--url", "http://x")
        assert (refused.exit_code, "No space left" in refused.stderr) == (2, True)
        with pytest.raises(LinkRevoked):
            _identity(tmp_path, made)


async def test_a_link_opens_the_running_console_until_it_is_revoked(tmp_path: Path) -> None:
    async with running_stack(tmp_path) as stack:
        state = tmp_path / "state"
        made = await asyncio.to_thread(
            _lockstep, state, "invite", "--role", "observer", "--expires", "1h", "--name", "Ada"
        )
        link = made.stdout.strip()
        assert link.startswith(f"{stack.console}/#token="), made.output
        async with Console(link, video=False, audio=False, name="") as console:
            async with asyncio.timeout(PATIENCE):
                async for _ in console.feedbacks():
                    if console.participants:
                        break
            assert [(each.name, each.role) for each in console.participants] == [("Ada", "observer")]
            revoked = await asyncio.to_thread(_lockstep, state, "revoke", _identity(state, link).token_id)
            assert "Ada" in revoked.stdout, revoked.output
            with pytest.raises(ConsoleLost):
                await asyncio.wait_for(_until_lost(console), PATIENCE)
        with pytest.raises(SignallingRefused, match="link_revoked"):
            async with Console(link, video=False, audio=False):
                pass
        listed = await asyncio.to_thread(_lockstep, state, "invitations")
        assert "revoked" in listed.stdout
        assert listed.stdout.count("at start") == 3
        follower = await asyncio.create_subprocess_exec(
            *(LOCKSTEP, "audit", "--follow", "--json"),
            stdout=asyncio.subprocess.PIPE,
            env=os.environ | {"LOCKSTEP_STATE_DIR": str(state)},
        )
        try:
            async with asyncio.timeout(PATIENCE), Console(stack.observer, video=False, audio=False) as console:
                await console.stop("seen by the one who follows")
                assert follower.stdout is not None
                found = [json.loads(line) async for line in _until_stop(follower.stdout)]
        finally:
            follower.terminate()
            await follower.wait()
    kinds = [record["kind"] for record in found]
    assert kinds[0] == "start"
    assert kinds[-1] == "stop"
    assert {"joined", "left", "invitation", "revocation"} <= set(kinds)
    assert [record["n"] for record in found] == list(range(1, len(found) + 1))


async def _until_lost(console: Console) -> None:
    async for _ in console.feedbacks():
        pass


async def _until_stop(lines: asyncio.StreamReader):  # type: ignore[no-untyped-def]
    async for line in lines:
        yield line
        if b'"kind":"stop"' in line:
            return


def test_without_a_console_the_settings_say_where_it_will_be(tmp_path: Path) -> None:
    made = _lockstep(tmp_path, "invite", "--role", "supervisor", "--expires", "30m", "--json")
    answer = json.loads(made.stdout)
    assert answer["link"].startswith("http://127.0.0.1:8000/#token=")
    assert (answer["role"], answer["good"], answer["revoked"]) == ("supervisor", True, False)
    assert _identity(tmp_path, answer["link"]).token_id == answer["id"]
    elsewhere = _lockstep(tmp_path, "invite", "--url", "https://robot.example/")
    assert elsewhere.stdout.startswith("https://robot.example/#token=")
    listed = json.loads(_lockstep(tmp_path, "invitations", "--json").stdout)
    assert {each["role"] for each in listed} == {"supervisor", "observer"}
    assert all("link" not in each for each in listed)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("invite", "--role", "admin"), "observer, operator, supervisor or policy"),
        (("invite", "--expires", "soon"), "not a time"),
        (("invite", "--expires", "1s"), "valid for 60"),
        (("revoke", "nothing"), "no such invitation"),
        (("audit",), "no audit log"),
    ],
)
def test_what_cannot_work_is_said_in_one_line(tmp_path: Path, arguments: tuple[str, ...], words: str) -> None:
    result = _lockstep(tmp_path, *arguments)
    assert (result.exit_code, result.stdout) == (2, "")
    assert words in result.stderr


def test_a_state_directory_that_cannot_be_used_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    result = _lockstep(tmp_path / "file", "invite")
    assert result.exit_code == 2
    assert "LOCKSTEP_STATE_DIR" in result.stderr


def test_after_a_clock_that_was_years_ahead_an_invitation_is_good(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    true = time.time
    _lockstep(tmp_path, "invite")
    with monkeypatch.context() as wrong:
        wrong.setattr(time, "time", lambda: true() + 20 * 365 * 86_400)
        open_state(Settings(state_dir=tmp_path)).invitations.keep_time()
    link = _lockstep(tmp_path, "invite", "--role", "operator").stdout.split()[-1]
    access = open_state(Settings(state_dir=tmp_path)).access
    assert access.verify(link.partition("=")[2]).role == "operator"


def test_revoking_twice_is_no_error(tmp_path: Path) -> None:
    made = json.loads(_lockstep(tmp_path, "invite", "--json").stdout)
    assert made["id"] in _lockstep(tmp_path, "revoke", made["id"]).stdout
    again = _lockstep(tmp_path, "revoke", made["id"])
    assert (again.exit_code, again.stdout) == (0, "")


def test_the_audit_is_shown_for_people_and_from_a_number_on(tmp_path: Path) -> None:
    file = AuditFile(tmp_path / "audit.jsonl", 10_000, 2)
    records = [
        AuditRecord(n=1, time=0.0, kind="joined", who="Ada", role="operator"),
        AuditRecord(n=2, time=0.0, kind="refusal", who="Ada", role="operator", event=7, what="late", count=3),
    ]
    file.write(records)
    file.close()
    shown = _lockstep(tmp_path, "audit").stdout.splitlines()
    assert len(shown) == 2
    for part in ("s=7", "refusal", "Ada (operator)", "late", "x3"):
        assert part in shown[1]
    assert len(_lockstep(tmp_path, "audit", "--after", "1").stdout.splitlines()) == 1
    assert json.loads(_lockstep(tmp_path, "audit", "--after", "1", "--json").stdout)["n"] == 2


def test_a_record_of_an_impossible_time_is_shown_like_all_others(tmp_path: Path) -> None:
    file = AuditFile(tmp_path / "audit.jsonl", 10_000, 2)
    file.write([AuditRecord(n=n, time=time, kind="stop") for n, time in ((1, 1e300), (2, -1e18), (3, 0.0))])
    file.close()
    shown = _lockstep(tmp_path, "audit")
    assert shown.exit_code == 0, shown.output
    assert [line.split()[0] for line in shown.stdout.splitlines()] == ["1", "2", "3"]


def test_a_key_that_is_a_folder_or_a_fifo_is_named_and_nothing_waits_for_it(tmp_path: Path) -> None:
    file = AuditFile(tmp_path / "audit.jsonl", 10_000, 2)
    file.write([AuditRecord(n=1, time=0.0, kind="stop")])
    file.close()
    for make in (Path.mkdir, os.mkfifo):
        make(tmp_path / "evidence.key")
        found = _lockstep(tmp_path, "audit", str(tmp_path), "--verify")
        assert found.exit_code == 2
        assert "evidence.key" in found.stderr
        assert "Traceback" not in found.output
        (tmp_path / "evidence.key").rmdir() if make is Path.mkdir else (tmp_path / "evidence.key").unlink()
    assert _lockstep(tmp_path, "audit", str(tmp_path), "--verify").exit_code == 0


async def test_the_audit_of_a_console_that_ran_is_verified_and_an_edit_and_a_cut_are_named(tmp_path: Path) -> None:
    async with running_stack(tmp_path):
        pass
    state = tmp_path / "state"
    key = _lockstep(state, "audit", "--key").stdout.strip()
    good = _lockstep(state, "audit", "--verify")
    assert good.exit_code == 0, good.output
    assert f"signed by {key}" in good.stdout
    assert json.loads(_lockstep(tmp_path / "other", "audit", str(state), "--verify", "--json").stdout)["ok"]
    wrong = _lockstep(state, "audit", "--verify", "--signed-by", "0" * 64)
    assert "but none fits this audit log and key" in wrong.stdout
    assert _lockstep(state, "audit", "--verify", "--signed-by", "key").exit_code == 2
    path = state / "audit.jsonl"
    whole = path.read_bytes()
    first, rest = whole.split(b"\n", 1)
    assert b'"kind":"start","what":"console ' in first
    path.write_bytes(first.replace(b"console ", b"Console ") + b"\n" + rest)
    edited = _lockstep(state, "audit", "--verify")
    assert edited.exit_code == 1
    assert "FAIL" in edited.stdout
    assert "does not fit record 1" in edited.stdout
    path.write_bytes(b"".join(whole.splitlines(keepends=True)[:-1]))
    cut = _lockstep(state, "audit", "--verify")
    assert cut.exit_code == 1
    assert "the end was cut off" in cut.stdout


def test_signed_heads_go_to_the_folder_that_the_setting_names(tmp_path: Path) -> None:
    settings = Settings(state_dir=tmp_path / "state", audit_anchor=tmp_path / "elsewhere")
    state = open_state(settings)
    anchors = AnchorFile(anchors_path(settings, state.directory.path), 1000)
    store = AuditStore(state.directory.path / "audit.jsonl", 10_000, 2, "", state.signer, anchors)
    store.write([AuditRecord(n=1, time=0.0, kind="stop")])
    store.close()
    assert (tmp_path / "elsewhere" / "audit-anchors.jsonl").exists()
    shown = _lockstep(tmp_path / "state", "audit", "--verify", "--anchors", str(tmp_path / "elsewhere"))
    assert "ok    1 signed heads fit" in shown.stdout, shown.output
