import threading
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import pytest
import structlog

from lockstep.server.auth import invitation_store
from lockstep.server.auth.invitation_store import FILE, InvitationStore
from lockstep.server.auth.invitations import Invitation, Invitations
from lockstep.server.auth.revoked_elsewhere import ELSEWHERE
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import LinkExpired, LinkRevoked
from lockstep.server.util.state_dir import StateDamaged, StateDir, StateDirUnusable

HOUR = 3600.0


def _invite(known: Invitations) -> Invitation:
    return known.invite(None, "observer", "Ada", HOUR, time.time())


@pytest.fixture
def directory(tmp_path: Path) -> StateDir:
    return StateDir(tmp_path)


def test_what_one_process_changes_another_sees(directory: StateDir) -> None:
    one, other = InvitationStore(directory), InvitationStore(directory)
    made = one.update(_invite)
    assert other.refresh() == [made]
    assert other.refresh() == []
    revoked = other.update(lambda known: known.revoke(None, made.id, time.time()))
    assert not one.is_revoked(made.id)
    assert one.refresh() == revoked
    assert one.is_revoked(made.id)
    assert InvitationStore(directory).is_revoked(made.id), "after a restart too"


def test_a_change_begins_with_what_others_wrote_meanwhile(directory: StateDir) -> None:
    one, other = InvitationStore(directory), InvitationStore(directory)
    made = {one.update(_invite).id, other.update(_invite).id}
    assert {each.id for each in InvitationStore(directory).known.all} == made


def test_a_change_that_fails_changes_nothing(directory: StateDir) -> None:
    store = InvitationStore(directory)
    store.update(_invite)
    before = (directory.path / FILE).read_bytes()

    def fail(known: Invitations) -> None:
        known.prune(time.time() + 1e9)
        raise ValueError

    with pytest.raises(ValueError):  # noqa: PT011
        store.update(fail)
    assert (directory.path / FILE).read_bytes() == before
    assert len(store.known.all) == 1


@pytest.mark.parametrize("data", [b"", b"rubbish", b'{"invitations": 1}', b'{"invitations": [{"id": 1}]}', b"\xff"])
def test_a_damaged_file_stops_the_start_and_not_a_console_that_runs(directory: StateDir, data: bytes) -> None:
    store = InvitationStore(directory)
    made = store.update(_invite)
    store.update(lambda known: known.revoke(None, made.id, time.time()))
    directory.write(FILE, data)
    with structlog.testing.capture_logs() as logs:
        assert store.refresh() == []
        assert store.refresh() == []
    assert [line["log_level"] for line in logs] == ["error"], "said once"
    assert store.is_revoked(made.id)
    assert store.trouble.startswith("the file is damaged")
    with pytest.raises(StateDamaged, match="signing.key"):
        InvitationStore(directory)


def test_a_file_that_vanishes_revives_no_link(directory: StateDir) -> None:
    store = InvitationStore(directory)
    made = store.update(_invite)
    store.update(lambda known: known.revoke(None, made.id, time.time()))
    (directory.path / FILE).unlink()
    assert store.refresh() == []
    assert store.is_revoked(made.id)
    assert store.trouble == "the file is missing"
    with pytest.raises(StateDamaged, match="missing"):
        store.update(_invite)
    with pytest.raises(StateDamaged, match="signing.key"):
        InvitationStore(directory)


def test_while_a_thread_changes_it_the_console_does_not_take_the_change_for_another_ones(directory: StateDir) -> None:
    store, seen = InvitationStore(directory), []

    def change(known: Invitations) -> None:
        _invite(known)
        seen.append(store.refresh())

    store.update(change)
    assert seen == [[]]
    assert store.refresh() == []


def test_the_file_holds_no_token_and_is_for_its_owner_only(directory: StateDir) -> None:
    InvitationStore(directory).update(_invite)
    path = directory.path / FILE
    assert b"eyJ" not in path.read_bytes()
    assert path.stat().st_mode & 0o777 == 0o600


def test_a_link_revoked_at_another_console_is_revoked_here_at_once_and_after_a_restart(directory: StateDir) -> None:
    store = InvitationStore(directory)
    end = time.time() + HOUR
    assert store.revoked_elsewhere({"far": end})
    assert store.is_revoked("far")
    assert not store.revoked_elsewhere({"far": end}), "nothing new"
    assert store.keep_revoked_elsewhere() == []
    again = InvitationStore(directory)
    assert again.is_revoked("far")
    assert again.revoked_links() == {"far": end}, "it is passed on"


def test_what_was_invited_here_with_a_link_that_is_revoked_elsewhere_ends_with_it(directory: StateDir) -> None:
    store = InvitationStore(directory)
    told: list[None] = []
    store.on_revoked = lambda: told.append(None)
    guest = Identity("operator", "Ann", "far", time.time() + HOUR)
    friend = store.update(lambda known: known.invite(guest, "observer", "Bob", HOUR / 2, time.time()))
    store.update(_invite)
    assert not told
    store.revoked_elsewhere({"far": time.time() + HOUR})
    assert [each.id for each in store.keep_revoked_elsewhere()] == [friend.id]
    assert store.is_revoked(friend.id)
    assert told, "others hear of that"
    assert store.keep_revoked_elsewhere() == []


def test_a_damaged_list_of_links_revoked_elsewhere_stops_the_start(directory: StateDir) -> None:
    directory.write(ELSEWHERE, b'{"revoked": [')
    with pytest.raises(StateDamaged):
        InvitationStore(directory)


def test_a_list_that_can_be_read_again_is_believed_again(directory: StateDir) -> None:
    store, other = InvitationStore(directory), InvitationStore(directory)
    made = store.update(_invite)
    good = (directory.path / FILE).read_bytes()
    directory.write(FILE, b"rubbish")
    store.refresh()
    assert store.trouble
    directory.write(FILE, good)
    assert store.refresh() == []
    assert not store.trouble
    assert other.refresh() == [made]


class _Wall:
    """The machine's clock, wrong by as much as is set."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.ahead = 0.0
        true = time.time
        monkeypatch.setattr("lockstep.server.auth.stored_clock.time.time", lambda: true() + self.ahead)


YEAR = 365 * 24 * HOUR


def test_a_start_with_a_clock_ahead_and_then_right_again_revives_no_revoked_link(
    directory: StateDir, monkeypatch: pytest.MonkeyPatch
) -> None:
    wall = _Wall(monkeypatch)
    store = InvitationStore(directory)
    made = store.update(_invite)
    store.update(lambda known: known.revoke(None, made.id, time.time()))
    wall.ahead = YEAR
    wrong = InvitationStore(directory)
    wrong.update(_invite)
    assert made.id not in {each.id for each in wrong.known.all}, "it has ended for so long that it is forgotten"
    wall.ahead = 0.0
    again = InvitationStore(directory)
    assert again.is_revoked(made.id) or again.clock.now() > made.expires
    with pytest.raises((LinkExpired, LinkRevoked)):
        again.check(made.identity, again.known)


def test_a_clock_that_goes_back_revives_no_expired_link(directory: StateDir, monkeypatch: pytest.MonkeyPatch) -> None:
    wall = _Wall(monkeypatch)
    store = InvitationStore(directory)
    made = store.update(_invite)
    wall.ahead = 2 * HOUR
    with pytest.raises(LinkExpired):
        store.check(made.identity, store.known)
    wall.ahead = -YEAR
    with pytest.raises(LinkExpired):
        store.check(made.identity, store.known)
    store.keep_time()
    again = InvitationStore(directory)
    assert again.clock.now() > made.expires, "over a restart neither"
    fresh = again.update(lambda known: known.invite(None, "observer", "Bob", HOUR, again.clock.now()))
    assert fresh.is_good(again.clock.now()), "links can still be given"


def test_links_revoked_elsewhere_stay_revoked_whatever_a_clock_says(
    directory: StateDir, monkeypatch: pytest.MonkeyPatch
) -> None:
    wall = _Wall(monkeypatch)
    store = InvitationStore(directory)
    store.update(_invite)
    end = time.time() + HOUR
    store.revoked_elsewhere({"far": end})
    store.keep_revoked_elsewhere()
    wall.ahead = YEAR
    InvitationStore(directory).keep_revoked_elsewhere()
    wall.ahead = 0.0
    again = InvitationStore(directory)
    assert again.is_revoked("far") or again.clock.now() > end


def test_whoever_was_revoked_while_their_request_waited_changes_nothing(directory: StateDir) -> None:
    store, other = InvitationStore(directory), InvitationStore(directory)
    ann = store.update(lambda known: known.invite(None, "operator", "Ann", HOUR, time.time()))
    other.update(lambda known: known.revoke(None, ann.id, time.time()))
    assert not store.is_revoked(ann.id), "it does not know yet"

    def invite(known: Invitations) -> None:
        store.check(ann.identity, known)
        pytest.fail("nobody may come this far")

    with pytest.raises(LinkRevoked):
        store.update(invite)


def test_whoever_was_revoked_here_or_elsewhere_and_not_on_this_disk_yet_changes_nothing(directory: StateDir) -> None:
    store = InvitationStore(directory)
    ann, bob = (store.update(lambda known: known.invite(None, "operator", "x", HOUR, time.time())) for _ in range(2))
    store.revoked_elsewhere({ann.id: ann.expires})
    store.end_at_once(Identity("supervisor", "Sue", "s", time.time() + HOUR), bob.id)
    for each in (ann, bob):
        assert not store.known.revoked()
        with pytest.raises(LinkRevoked):
            store.update(partial(store.check, each.identity))


def test_of_two_processes_the_later_time_is_kept(directory: StateDir, monkeypatch: pytest.MonkeyPatch) -> None:
    wall = _Wall(monkeypatch)
    store, other = InvitationStore(directory), InvitationStore(directory)
    store.update(_invite)
    wall.ahead = YEAR
    store.keep_time()
    wall.ahead = 0.0
    other.keep_time()
    assert other.clock.now() > time.time() + YEAR - HOUR
    assert InvitationStore(directory).clock.now() > time.time() + YEAR - HOUR


def _trouble(store: InvitationStore) -> str:
    return store.trouble


def test_a_change_that_does_not_end_is_trouble_after_a_while_since_nobody_knows_what_others_revoked_meanwhile(
    directory: StateDir, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, hangs, ends = InvitationStore(directory), threading.Event(), threading.Event()

    def hang(known: Invitations) -> Invitation:
        hangs.set()
        ends.wait()
        return _invite(known)

    with ThreadPoolExecutor(1) as thread:
        made = thread.submit(store.update, hang)
        try:
            assert hangs.wait(10)
            assert store.refresh() == []
            assert not _trouble(store), "a disk may be slow"
            monkeypatch.setattr(invitation_store, "HANGS_AFTER", 0.0)
            with structlog.testing.capture_logs() as logs:
                assert store.refresh() == store.refresh() == []
            assert _trouble(store) == "the disk does not answer"
            assert [each["log_level"] for each in logs] == ["error"], "shouted once"
        finally:
            ends.set()
        made.result()
    store.refresh()
    assert not _trouble(store)


def test_a_link_that_was_revoked_while_the_disk_was_full_stays_revoked_after_a_crash(
    directory: StateDir, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = InvitationStore(directory)
    boss = store.update(lambda known: known.invite(None, "supervisor", "Boss", HOUR, time.time())).identity
    made = store.update(lambda known: known.invite(None, "operator", "Mallory", HOUR, time.time()))
    below = store.update(lambda known: known.invite(made.identity, "observer", "Eve", HOUR / 2, time.time()))
    store.keep_time()
    beside = InvitationStore(directory)

    def full(*_: object) -> None:
        raise StateDirUnusable(directory.path, "No space left on device")

    with monkeypatch.context() as disk:
        disk.setattr(StateDir, "write", full)
        store.end_at_once(boss, made.id)
        with pytest.raises(StateDirUnusable):
            store.update(lambda known: known.revoke(boss, made.id, time.time()))
        store.unwritten.add(made.id)
        store.unwritten.note()
        beside.refresh()
        assert beside.is_revoked(below.id), "a console that runs hears of what a command beside it has noted"
        fresh = InvitationStore(directory)
        assert (fresh.is_revoked(made.id), fresh.is_revoked(below.id)) == (True, True)
        assert not fresh.is_revoked(boss.token_id)
    assert {each.id for each in fresh.keep_ended()} == {made.id, below.id}
    assert InvitationStore(directory).known.revoked() == {made.id, below.id}
    assert not InvitationStore(directory).unwritten, "what was set aside is free again"
