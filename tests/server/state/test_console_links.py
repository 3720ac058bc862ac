import socket
import time
from pathlib import Path

import pytest

from lockstep.server.http.transport.serve import PortTaken, bind
from lockstep.server.settings import Settings
from lockstep.server.state.console_links import console_links, listening_url
from lockstep.server.state.persistent_state import ConsoleState, open_state
from lockstep.server.util.state_dir import StateDirUnusable


@pytest.fixture
def state(tmp_path: Path) -> ConsoleState:
    return open_state(Settings(state_dir=tmp_path))


@pytest.mark.parametrize(("host", "shown"), [("127.0.0.1", "http://127.0.0.1:"), ("::1", "http://[::1]:")])
def test_links_name_the_address_that_is_really_listened_on(host: str, shown: str) -> None:
    with bind(host, 0) as listener:
        assert listening_url(Settings(host=host), listener) == f"{shown}{listener.getsockname()[1]}"


def test_a_console_on_all_interfaces_names_one_that_others_can_reach() -> None:
    with bind("0.0.0.0", 0) as listener:
        assert "0.0.0.0" not in listening_url(Settings(host="0.0.0.0"), listener)


def test_a_public_address_is_shown_instead() -> None:
    with bind("127.0.0.1", 0) as listener:
        assert listening_url(Settings(public_url="https://robot.example/"), listener) == "https://robot.example"


def test_there_is_one_link_for_each_role(state: ConsoleState) -> None:
    links = console_links(Settings(), "http://here", state)
    assert (links.console, links.robot) == ("http://here", "tcp://127.0.0.1:5600")
    for role in ("operator", "observer", "supervisor"):
        link = getattr(links, role)
        assert link.startswith("http://here/#token=")
        assert state.access.verify(link.partition("=")[2]).role == role


def test_the_next_start_prints_the_same_links_until_one_is_revoked(state: ConsoleState) -> None:
    links = console_links(Settings(), "http://here", state)
    assert console_links(Settings(), "http://here", state) == links
    identity = state.access.verify(links.observer.partition("=")[2])
    state.invitations.update(lambda known: known.revoke(None, identity.token_id, time.time()))
    again = console_links(Settings(), "http://here", state)
    assert again.observer != links.observer
    assert again.operator == links.operator


def test_after_a_clock_that_was_years_ahead_the_links_that_are_printed_are_good(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    true = time.time
    console_links(Settings(), "http://here", open_state(Settings(state_dir=tmp_path)))
    with monkeypatch.context() as wrong:
        wrong.setattr(time, "time", lambda: true() + 20 * 365 * 86_400)
        open_state(Settings(state_dir=tmp_path)).invitations.keep_time()
    state = open_state(Settings(state_dir=tmp_path))
    links = console_links(Settings(), "http://here", state)
    for role in ("operator", "observer", "supervisor"):
        assert state.access.verify(getattr(links, role).partition("=")[2]).role == role


def test_a_full_disk_does_not_keep_the_links_from_being_printed(
    state: ConsoleState, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise StateDirUnusable(Path("state"), "No space left on device")

    monkeypatch.setattr(state.directory, "write", full)
    links = console_links(Settings(), "http://here", state)
    assert state.access.verify(links.supervisor.partition("=")[2]).role == "supervisor"
    assert state.invitations.known.all == []


def test_people_get_the_links_and_are_told_what_they_are_for(state: ConsoleState) -> None:
    links = console_links(Settings(), "http://here", state)
    text = links.for_people()
    assert f"To drive, open:   {links.operator}" in text
    assert f"To watch, open:   {links.observer}" in text
    assert f"To supervise:     {links.supervisor}" in text


def test_a_port_or_address_that_cannot_be_had_is_named() -> None:
    with bind("127.0.0.1", 0) as listener:
        port = listener.getsockname()[1]
        with pytest.raises(PortTaken, match=rf"127\.0\.0\.1:{port}"):
            bind("127.0.0.1", port)
    with pytest.raises(PortTaken):
        bind("192.0.2.1", 0)
    with pytest.raises(PortTaken):
        bind("no such host", 0)


def test_a_bound_socket_is_a_listening_one() -> None:
    with bind("127.0.0.1", 0) as listener, socket.create_connection(listener.getsockname(), timeout=5):
        pass
