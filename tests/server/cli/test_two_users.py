"""Root's commands beside a console of another user, as under systemd's DynamicUser."""

import os
import pwd
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from lockstep.server.auth.invitation_store import FILE, InvitationStore
from lockstep.server.settings import Settings
from lockstep.server.state.persistent_state import open_state
from lockstep.server.util.state_dir import StateDamaged, StateDir, StateDirUnusable

HOUR = 3600.0
pytestmark = pytest.mark.skipif(os.geteuid() != 0, reason="only root can be two users")


@pytest.fixture
def nobodys() -> Iterator[Path]:
    """A state directory that belongs to `nobody`; above it everybody may pass."""
    nobody = pwd.getpwnam("nobody")
    place = Path(tempfile.mkdtemp(prefix="lockstep-users-"))
    place.chmod(0o755)
    directory = place / "state"
    directory.mkdir(mode=0o700)
    os.chown(directory, nobody.pw_uid, nobody.pw_gid)
    yield directory
    shutil.rmtree(place)


def _as_nobody(work: str, directory: Path) -> str:
    """What `work` prints, in a process that has become `nobody` once everything is imported."""
    nobody = pwd.getpwnam("nobody")
    script = f"""
import os, sys, time
from pathlib import Path
from lockstep.server.auth.invitation_store import InvitationStore
from lockstep.server.settings import Settings
from lockstep.server.state.persistent_state import open_state
from lockstep.server.util.state_dir import StateDir
os.setgroups([]); os.setgid({nobody.pw_gid}); os.setuid({nobody.pw_uid})
directory = Path({str(directory)!r})
{work}
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def _lockstep(directory: Path, *arguments: str) -> str:
    command = (
        sys.executable,
        "-c",
        "from lockstep.server.cli.main import main; main()",
        *arguments,
        "--state-dir",
        str(directory),
    )
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_what_root_invites_and_revokes_the_console_of_another_user_can_read(nobodys: Path) -> None:
    link = _lockstep(nobodys, "invite", "--role", "operator", "--url", "http://console.example")
    known = _as_nobody("print(*[each.id for each in InvitationStore(StateDir(directory)).known.all])", nobodys)
    assert known
    _lockstep(nobodys, "revoke", known)
    asked = f"""
state = open_state(Settings(state_dir=directory))
print(state.invitations.is_revoked({known!r}), state.invitations.trouble == "")
state.invitations.update(lambda known: known.invite(None, "observer", "x", 3600, time.time()))
from lockstep.server.errors import LinkRevoked
try:
    state.access.verify({link.partition("#token=")[2]!r})
except LinkRevoked:
    print("refused")
"""
    assert _as_nobody(asked, nobodys).split() == ["True", "True", "refused"]
    nobody = pwd.getpwnam("nobody")
    assert {each.stat().st_uid for each in nobodys.iterdir()} == {nobody.pw_uid}
    assert {each.stat().st_mode & 0o777 for each in nobodys.iterdir()} == {0o600}


def test_a_console_that_runs_hears_of_what_root_revokes(nobodys: Path) -> None:
    made = _as_nobody(
        "made = InvitationStore(StateDir(directory)).update("
        'lambda known: known.invite(None, "operator", "x", 3600, time.time())); print(made.id)',
        nobodys,
    )
    beside = f"""
import subprocess
store = InvitationStore(StateDir(directory))
assert not store.is_revoked({made!r})
print("ready", flush=True)
sys.stdin.readline()
store.refresh()
print(store.is_revoked({made!r}), store.trouble == "")
"""
    nobody = pwd.getpwnam("nobody")
    script = (
        "import os, sys, time\nfrom pathlib import Path\n"
        "from lockstep.server.auth.invitation_store import InvitationStore\n"
        "from lockstep.server.util.state_dir import StateDir\n"
        f"os.setgroups([]); os.setgid({nobody.pw_gid}); os.setuid({nobody.pw_uid})\n"
        f"directory = Path({str(nobodys)!r})\n{beside}"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as running:
        assert running.stdin is not None
        assert running.stdout is not None
        assert running.stdout.readline().strip() == "ready"
        _lockstep(nobodys, "revoke", made)
        running.stdin.write("\n")
        running.stdin.flush()
        assert running.stdout.readline().split() == ["True", "True"]


def test_a_list_that_the_console_may_not_read_lets_nobody_in_and_it_does_not_start_with_another_key(
    nobodys: Path,
) -> None:
    _as_nobody("open_state(Settings(state_dir=directory)).invitations.update(lambda known: None)", nobodys)
    asked = """
state = open_state(Settings(state_dir=directory), fall_back=True)
token = state.access.issue("operator", "x")
state.access.verify(token)
print("let in")
sys.stdout.flush()
sys.stdin.readline()
"""
    assert _as_nobody(asked.replace("sys.stdin.readline()", ""), nobodys) == "let in"
    os.chown(nobodys / FILE, 0, 0)
    refused = """
try:
    open_state(Settings(state_dir=directory), fall_back=True)
except Exception as error:
    print(type(error).__name__, error)
"""
    said = _as_nobody(refused, nobodys)
    assert said.startswith("StateDirUnusable")
    assert "Permission denied" in said


def test_a_link_that_somebody_put_where_a_lock_belongs_is_not_followed(nobodys: Path, tmp_path: Path) -> None:
    target = tmp_path / "roots"
    target.write_text("precious")
    (nobodys / "lock").symlink_to(target)
    with pytest.raises(StateDirUnusable):
        InvitationStore(StateDir(nobodys)).update(lambda known: known.invite(None, "observer", "x", HOUR, time.time()))
    assert target.stat().st_uid == 0


def test_a_directory_that_was_used_is_never_replaced_by_a_new_one(tmp_path: Path) -> None:
    settings = Settings(state_dir=tmp_path)
    open_state(settings).invitations.update(lambda known: known.invite(None, "observer", "x", HOUR, time.time()))
    (tmp_path / FILE).unlink()
    (tmp_path / FILE).mkdir()
    with pytest.raises(StateDirUnusable):
        open_state(settings, fall_back=True)
    assert issubclass(StateDamaged, StateDirUnusable)
