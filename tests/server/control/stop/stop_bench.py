"""The STOP of a console, its resets and silences, with a robot that answers when the test says so."""

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import pytest

from lockstep.protocol.console import Role, ServerMessage
from lockstep.protocol.messages import Feedback, Reset, Stop, StopState, StopTaken
from lockstep.server.audit.audit_tail import AuditTail
from lockstep.server.audit.audit_trail import AuditTrail
from lockstep.server.audit.records import Actor, AuditRecord
from lockstep.server.auth.silenced_links import SilencedLinks
from lockstep.server.auth.tokens import Identity
from lockstep.server.control.notices import Notices
from lockstep.server.control.session_audit import SessionAudit
from lockstep.server.control.stop.reset_service import ResetService
from lockstep.server.control.stop.stop_service import StopService
from lockstep.server.control.stop.stop_silence import StopSilence
from lockstep.server.control.stop.stops_disk import StopsDisk
from lockstep.server.errors import (
    ConsoleError,
)
from lockstep.server.event_clock import EventClock
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.session_events import SessionEvents
from lockstep.server.stop.stop_keeper import StopKeeper
from lockstep.server.stop.stop_presses import Press
from lockstep.server.telemetry.metrics import Metrics
from tests.server.rig import PATIENCE


class FakeRobot:
    def __init__(self) -> None:
        self.up = True
        self.media_up = False
        self.detail = "no bridge"
        self.sent: list[Stop | Reset] = []

    def send(self, message: Reset) -> bool:
        if self.up:
            self.sent.append(message)
        return self.up

    def send_stop(self, stop: Stop) -> bool:
        if self.up or self.media_up:
            self.sent.append(stop)
        return self.up or self.media_up


class FakePeer:
    def __init__(self, name: str, role: Role) -> None:
        self.id = f"{name}-1"
        self.name = name
        self.role = role
        self.identity = Identity(role, name, f"link of {name}", 1e12)
        self.silenced = False
        self.told: list[ServerMessage] = []

    @property
    def actor(self) -> Actor:
        return Actor(self.name, self.role, self.id, self.identity.token_id)

    def send(self, channel: str, message: ServerMessage) -> None:
        self.told.append(message)


class FakePeers:
    def __init__(self) -> None:
        self.all = {
            name: FakePeer(name, role)
            for name, role in cast(
                list[tuple[str, Role]],
                [("ann", "operator"), ("bob", "operator"), ("olga", "observer"), ("sue", "supervisor")],
            )
        }
        self.told: list[ServerMessage] = []

    def __iter__(self) -> Iterator[FakePeer]:
        return iter(self.all.values())

    def by_id(self, peer_id: str) -> FakePeer | None:
        return next((peer for peer in self if peer.id == peer_id), None)

    def tell(self, channel: str, message: ServerMessage) -> None:
        self.told.append(message)

    def announce(self, message: ServerMessage) -> None:
        self.told.append(message)


class StopBench:
    """Ann holds the seat; the link is up."""

    def __init__(self, directory: Path) -> None:
        self.robot, self.peers, self.clock, self.tail = FakeRobot(), FakePeers(), EventClock(), AuditTail()
        self.keeper = StopKeeper(directory, "tcp://robot:1")
        self.directory = directory
        self.holder = "ann-1"
        self.issue = 0
        self.audit = AuditTrail(self.clock, self.tail)
        peers = cast(PeerRegistry, self.peers)
        self.notices = Notices(peers)
        events = SessionEvents(Metrics(process=False).faults)
        SessionAudit(self.audit).subscribe(events)
        self.notices.subscribe(events)
        self.silence = StopSilence(SilencedLinks(), peers, events)
        self.service = StopService(
            self.robot,
            self.keeper,
            peers,
            self.clock,
            self.silence,
            events,
        )
        self.disk = StopsDisk(self.keeper, events)
        self.resets = ResetService(self.robot, self.service, peers, self.clock, self, events)

    def press(self, who: str, id_: str, where: str = "stop") -> Press:
        press = Press(id=id_, by=self.peers.all[who].actor, where=where, reason="smoke")
        self.service.stop(press)
        return press

    def take(self, id_: str, number: int, *, kept: bool = True) -> None:
        self.service.taken(StopTaken(press=id_, number=number, kept=kept))

    def show(self, stop: StopState) -> None:
        self.issue += 1
        feedback = Feedback(event=1, issue=self.issue, time=0.0, axes=[], stop=stop)
        assert self.clock.observe(feedback, 0.0)
        self.resets.feedback(stop)

    def stopped(self, number: int) -> None:
        self.show(StopState(stopped=True, number=number))

    def lose(self) -> None:
        self.robot.up = False
        self.service.robot_link_down()
        self.resets.robot_link_down("gone")

    def reset(self, who: str, number: int, *, peer: bool = False) -> "asyncio.Task[None]":
        actor = self.peers.all[who].actor
        by = actor if peer else actor._replace(peer="")
        return asyncio.create_task(self.resets.reset(by, "http", number))

    def records(self, kind: str) -> list[AuditRecord]:
        self.audit.flush()
        return [record for record in self.tail if record.kind == kind]

    def heard(self, who: str, kind: type[Any]) -> list[Any]:
        return [message for message in self.peers.all[who].told if isinstance(message, kind)]

    @property
    def on_disk(self) -> int:
        return len(list(self.directory.rglob("*.json")))


async def raised(reset: "asyncio.Task[None]") -> type[ConsoleError]:
    with pytest.raises(ConsoleError) as caught:
        async with asyncio.timeout(PATIENCE):
            await reset
    return type(caught.value)
