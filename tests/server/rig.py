"""A real console on a real bridge with the planar robot, and peers to talk to it."""

import asyncio
import ssl
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from tempfile import TemporaryDirectory
from typing import Any

import httpx
import pytest
from aiortc import RTCConfiguration, RTCDataChannel, RTCPeerConnection, RTCSessionDescription
from fastapi import FastAPI

from lockstep.protocol.console import ClientMessage, Role, ServerMessage, decode_server_message
from lockstep.protocol.console import encode_console_message as encode
from lockstep.protocol.messages import Command, Feedback, Refusal, StopState
from lockstep.protocol.serial import event_after
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.robots.registry import create_robot
from lockstep.robot_bridge.settings import BridgeSettings
from lockstep.server.auth.stored_clock import StoredClock
from lockstep.server.auth.tokens import Access, Identity
from lockstep.server.composition.robot_app import create_app
from lockstep.server.http.transport.serve import bind, running
from lockstep.server.http.transport.tls import Certificate
from lockstep.server.http.transport.uvicorn_http_limits import bounded_by
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.webrtc_transport import WebRtcTransport
from lockstep.server.settings import Settings
from lockstep.server.state.dependencies import Dependencies
from lockstep.server.state.persistent_state import open_state
from tests.waiting import PATIENCE, eventually

__all__ = [
    "PATIENCE",
    "Rig",
    "TestPeer",
    "eventually",
    "links_that_expire",
    "reset_by_http",
    "running_bridge",
    "running_console",
    "running_rig",
    "stop_words",
]

HELD_UP = ("late", "not_neutral", "unseen")  # refusals that follow when a busy machine held the robot or us up
HOUR = 3600.0  # s


@dataclass
class Rig:
    """A running console.

    Attributes:
        url: "http://127.0.0.1:PORT"
    """

    url: str
    app: FastAPI
    access: Access
    http: httpx.AsyncClient

    @property
    def dependencies(self) -> Dependencies:
        found = self.app.state.dependencies
        assert isinstance(found, Dependencies)
        return found

    @property
    def webrtc_peers(self) -> list[Peer]:
        return [peer for peer in self.dependencies.console.peers if isinstance(peer.transport, WebRtcTransport)]

    def token(self, role: Role) -> dict[str, str]:
        return {"Authorization": f"Bearer {self.access.issue(role, role)}"}

    def token_for_an_hour(self, role: Role) -> dict[str, str]:
        """With `links_that_expire` it ends when the test wants it to, however busy the machine is."""
        token = self.access.sign(Identity(role, "x", "id", time.time() + HOUR), time.time())
        return {"Authorization": f"Bearer {token}"}

    async def session(self) -> dict[str, Any]:
        answer = await self.http.get("/api/session", headers=self.token("observer"))
        found: dict[str, Any] = answer.json()
        return found

    def count(self, name: str, **labels: str) -> float:
        """A metric's value; 0 when it was never touched."""
        return self.dependencies.metrics.registry.get_sample_value(name, labels) or 0.0

    @asynccontextmanager
    async def peer(self, role: Role, *channels: str) -> AsyncIterator["TestPeer"]:
        """A peer with open data channels."""
        peer = TestPeer()
        try:
            await peer.join(self, self.token(role), channels or ("control", "session", "stop"))
            yield peer
        finally:
            await peer.close()


class TestPeer:
    """Speaks on data channels; keeps all that it hears."""

    __test__ = False

    def __init__(self) -> None:
        self.pc = RTCPeerConnection(RTCConfiguration(iceServers=[]))
        self.channels: dict[str, RTCDataChannel] = {}
        self.heard: list[ServerMessage] = []
        self.closed = asyncio.Event()
        self.location = ""
        self.tag = ""  # of its ICE session
        self.headers: dict[str, str] = {}  # with its token
        self.answer_headers = httpx.Headers()
        self._news = asyncio.Event()

    async def join(self, rig: Rig, headers: dict[str, str], labels: tuple[str, ...], path: str = "/whep") -> None:
        opened = []
        for label in labels:
            lossy = label == "control"
            channel = self.pc.createDataChannel(label, ordered=not lossy, maxRetransmits=0 if lossy else None)
            channel.on("message", self._hear)
            channel.on("close", self.closed.set)
            opened.append(self._until_open(channel))
            self.channels[label] = channel
        offer = await self.offer()
        answer = await rig.http.post(path, content=offer, headers={**headers, "Content-Type": "application/sdp"})
        assert answer.status_code == 201, answer.text
        self.answer_headers = answer.headers
        self.headers, self.location, self.tag = headers, answer.headers["location"], answer.headers["etag"]
        await self.pc.setRemoteDescription(RTCSessionDescription(answer.text, "answer"))
        async with asyncio.timeout(PATIENCE):
            await asyncio.gather(*opened)

    async def offer(self) -> str:
        await self.pc.setLocalDescription(await self.pc.createOffer())
        return self.pc.localDescription.sdp

    def send(self, channel: str, message: ClientMessage) -> None:
        self.channels[channel].send(encode(message))

    def send_raw(self, channel: str, data: str | bytes) -> None:
        self.channels[channel].send(data)

    async def until(self, found: Callable[[ServerMessage], bool]) -> ServerMessage:
        """The first message, heard already or to come, that `found` says yes to."""
        async with asyncio.timeout(PATIENCE):
            while True:
                for message in self.heard:
                    if found(message):
                        return message
                self._news.clear()
                await self._news.wait()

    async def feedback(self, found: Callable[[Feedback], bool] = lambda _: True) -> Feedback:
        message = await self.until(lambda each: isinstance(each, Feedback) and found(each))
        assert isinstance(message, Feedback)
        return message

    def newest_feedback(self) -> Feedback:
        return next(each for each in reversed(self.heard) if isinstance(each, Feedback))

    async def drive(self, values: list[float]) -> Feedback:
        """The next event, with these values. A robot that was held up gets the neutral command first that it wants."""
        while (executed := await self._executed(values)) is None:
            await self._executed([0.0] * len(values))
        return executed

    async def _executed(self, values: list[float]) -> Feedback | None:
        """None: it was refused, because somebody was held up."""
        now = self.newest_feedback()
        event = event_after(now.event)
        old = {id(each) for each in self.heard if isinstance(each, Refusal)}
        self.send("control", Command(event=event, issue=now.issue, nonce=now.nonce, values=values))

        def answers(each: ServerMessage) -> bool:
            return isinstance(each, Feedback | Refusal) and each.event == event and id(each) not in old

        answer = await self.until(answers)
        if isinstance(answer, Refusal):
            assert answer.reason in HELD_UP, answer
            return None
        assert isinstance(answer, Feedback)
        return answer

    async def close(self) -> None:
        await self.pc.close()

    def _hear(self, text: str) -> None:
        self.heard.append(decode_server_message(text))
        self._news.set()

    async def _until_open(self, channel: RTCDataChannel) -> None:
        if channel.readyState != "open":
            opened = asyncio.Event()
            channel.on("open", opened.set)
            await opened.wait()


def links_that_expire(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """For consoles that start afterwards: return a function that lets more than an hour pass for links at once."""
    now, passed = StoredClock.now, [0.0]
    monkeypatch.setattr(StoredClock, "now", lambda clock: now(clock) + passed[-1])
    return lambda: passed.append(1.1 * HOUR)


def stop_words(stop: StopState) -> tuple[str, str] | None:
    """Who stopped and why; None while nothing is stopped."""
    return (stop.by, stop.reason) if stop.stopped else None


async def reset_by_http(
    http: httpx.AsyncClient, path: str, headers: dict[str, str], stop: Callable[[], StopState]
) -> None:
    """Reset until the stop is released: the bridge takes none within a second of it. `headers`: a supervisor's."""
    async with asyncio.timeout(PATIENCE):
        while stop().stopped:
            await http.post(path, headers=headers, json={"number": stop().number})
            await asyncio.sleep(0.4)


@asynccontextmanager
async def running_bridge(port: int = 0) -> AsyncIterator[Bridge]:
    async with Bridge(create_robot("planar"), BridgeSettings(port=port)) as bridge:
        yield bridge


@asynccontextmanager
async def running_console(
    robot_port: int, *, certificate: Certificate | None = None, **settings: Any
) -> AsyncIterator[Rig]:
    """A console on a free port; the scene only when asked for. With a certificate it speaks TLS."""
    with TemporaryDirectory() as directory:
        given: dict[str, Any] = {
            "robot": f"tcp://127.0.0.1:{robot_port}",
            "port": 0,
            "scene": False,
            "state_dir": directory,
        }
        async with _console(Settings(**(given | settings)), certificate) as rig:
            yield rig


@asynccontextmanager
async def _console(wanted: Settings, certificate: Certificate | None) -> AsyncIterator[Rig]:
    state = open_state(wanted)
    app = create_app(wanted, state)
    listener = bind(wanted.host, wanted.port)
    try:
        url = f"{'https' if certificate else 'http'}://127.0.0.1:{listener.getsockname()[1]}"
        verify = ssl.create_default_context(cafile=certificate.chain) if certificate else False
        async with (
            running(app, listener, http=bounded_by(wanted, app), tls=certificate),
            httpx.AsyncClient(base_url=url, trust_env=False, verify=verify, timeout=PATIENCE) as http,
        ):
            yield Rig(url, app, state.access, http)
    finally:
        listener.close()


@asynccontextmanager
async def running_rig(**settings: Any) -> AsyncIterator[Rig]:
    """Bridge and console, connected."""
    async with running_bridge() as bridge, running_console(bridge.address[1], **settings) as rig:
        async with asyncio.timeout(PATIENCE):
            await rig.dependencies.console.robot.reached.wait()
        yield rig
