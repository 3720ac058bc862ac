from collections.abc import Callable
from typing import Any

import pytest
from prometheus_client import Counter

from lockstep.protocol.console import Notice, RecordingState, ServerMessage
from lockstep.server.audit.records import Actor
from lockstep.server.control.notices import Notices
from lockstep.server.session_events import NewcomerWelcomed, SessionEvents
from lockstep.server.telemetry.faults import Faults


class _Peer:
    def __init__(self) -> None:
        self.told: list[ServerMessage] = []

    def send(self, channel: str, message: ServerMessage) -> None:
        assert channel == "session"
        self.told.append(message)


class _Peers:
    def __init__(self, **here: _Peer) -> None:
        self.by_id = here.get


@pytest.fixture
def events() -> SessionEvents:
    return SessionEvents(Faults(Counter("faults", "Faults of the test.", ("where",), registry=None)))


def _notices(peers: Any, events: SessionEvents, *states: Callable[[], ServerMessage]) -> None:
    Notices(peers, states, "disk full").subscribe(events)


def test_a_newcomer_alone_is_told_what_it_has_missed(events: SessionEvents) -> None:
    ann, bob = _Peer(), _Peer()
    _notices(_Peers(ann=ann, bob=bob), events, lambda: RecordingState(state="off"))
    events.publish(NewcomerWelcomed(peer=Actor("Ann", "operator", "ann", "link")))
    recording, disk = ann.told
    assert recording == RecordingState(state="off")
    assert isinstance(disk, Notice)
    assert "disk full" in disk.text
    assert bob.told == []


def test_a_newcomer_who_has_left_meanwhile_is_told_nothing(events: SessionEvents) -> None:
    _notices(_Peers(), events, lambda: pytest.fail("asked for nobody"))
    events.publish(NewcomerWelcomed(peer=Actor("Ann", "operator", "ann", "link")))
