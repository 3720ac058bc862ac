"""Receives pictures, sound and feedback through a Janus; everything else comes from the console."""

import asyncio
import itertools
import secrets
from collections.abc import Callable
from typing import Any

import msgspec
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidHandshake, WebSocketException
from websockets.typing import Subprotocol

from lockstep.client.errors import ConnectFailed
from lockstep.client.transport.endpoints import open_endpoint
from lockstep.client.transport.media_sections import receiving
from lockstep.client.transport.message_turns import MAX_UNREAD, in_turns
from lockstep.client.transport.paced_connection import PacedConnection
from lockstep.client.transport.packets import Packets
from lockstep.client.transport.sdp import Section, read_sections
from lockstep.protocol.console import StreamInfo
from lockstep.protocol.errors import MessageError
from lockstep.protocol.janus import JANUS_PROTOCOL, VIDEO_ROOM, Heard, complete_description, janus_request, parse_janus
from lockstep.rtc.channels import ChannelMessage
from lockstep.rtc.dcep import Reliability
from lockstep.rtc.endpoint import Connection, Endpoint
from lockstep.rtc.interfaces import own_addresses
from lockstep.rtc.peer import PeerNotReady, PeerSettings
from lockstep.rtc.peer_events import PeerEnded, PeerEvent
from lockstep.rtc.sdp import SdpError, SessionDescription, parse_description, write_description

__all__ = ["RelayMedia", "RelayTicket"]

ANSWER_SECONDS = 10.0
CLOSE_SECONDS = 1.0  # for the relay's own close frame
KEEPALIVE_SECONDS = 25.0  # Janus forgets a session after 60 s
SILENCE_SECONDS = 1.5  # without a message on the feedback channel; the console sends one there every 0.4 s
HELD_UP_SECONDS, MOST_HELD_UP = 0.1, 3  # late by so much, this process was held up; forgiven so many times in a row
MAX_MESSAGE = 256 * 1024  # bytes


class RelayTicket(msgspec.Struct, frozen=True, kw_only=True):
    """The answer of GET /api/relay. For a relay other than Janus, only `engine` counts."""

    engine: str
    relay: str
    url: str
    feed: int
    room: int = 0
    pin: str = ""
    streams: list[StreamInfo]


class RelayMedia:
    """The media of a session, from a Janus. Order: `negotiate`, tell `packets` where they go, `connect`; `run` until
    `ended`, then `close`."""

    def __init__(self, ticket: RelayTicket, on_message: Callable[[str | bytes], None]) -> None:
        if ticket.engine != "janus":
            raise ConnectFailed(f"this client can watch through Janus, but not through {ticket.engine}")
        self.ended = asyncio.Event()
        self.why = ""
        self.packets: Packets | None = None  # the source of media packets, after `negotiate`
        self._ticket = ticket
        self._on_message = on_message
        self._socket: ClientConnection | None = None
        self._session: int | None = None
        self._handle: int | None = None
        self._numbers = itertools.count(1)
        self._prefix = secrets.token_hex(4)
        self._heard = asyncio.Event()
        self._endpoint: Endpoint | None = None
        self._connection: Connection | None = None
        self._offer: SessionDescription | None = None

    @property
    def name(self) -> str:
        """The relay's number at the console."""
        return self._ticket.relay

    async def negotiate(self, wanted: Callable[[StreamInfo], bool] = lambda _: True) -> list[Section]:
        """Subscribe and return the sections of the coming media. Raises ConnectFailed."""
        try:
            self._socket = await connect(
                self._ticket.url,
                subprotocols=[Subprotocol(JANUS_PROTOCOL)],
                open_timeout=ANSWER_SECONDS,
                max_size=MAX_MESSAGE,
                max_queue=MAX_UNREAD,
                close_timeout=CLOSE_SECONDS,
                ping_interval=None,
                compression=None,  # a few short messages
                proxy=None,
                create_connection=PacedConnection,
            )
        except (OSError, TimeoutError, InvalidHandshake) as error:
            raise ConnectFailed(f"no relay at {self._ticket.url} ({error or type(error).__name__})") from error
        self._session = _identifier(await self._ask("create"))
        self._handle = _identifier(await self._ask("attach", plugin=VIDEO_ROOM))
        streams = [stream for stream in self._ticket.streams if wanted(stream)]
        mids = [stream.mid for stream in streams] + [str(len(self._ticket.streams))]  # feedback is the last
        body = {
            "request": "join",
            "ptype": "subscriber",
            "room": self._ticket.room,
            "pin": self._ticket.pin,
            "streams": [{"feed": self._ticket.feed, "mid": mid} for mid in mids],
        }
        heard = await self._ask("message", body=body)
        if heard.jsep is None:
            raise ConnectFailed("the relay sent no offer")
        offer = complete_description(str(heard.jsep["sdp"]))
        try:
            self._offer = parse_description(offer)
        except SdpError as error:
            raise ConnectFailed(f"the relay's offer cannot be used: {error}") from error
        self._endpoint = open_endpoint(own_addresses())
        # The client opens DTLS, because it knows first that ICE has found a path.
        settings = PeerSettings(setup="active")
        self._connection = self._endpoint.connect(controlling=False, settings=settings, listener=self._event)
        self.packets = Packets(self._connection, "trailer", of_relay=True)
        return _named(read_sections(offer), heard.data, {stream.mid: stream.stream for stream in streams})

    @property
    def connection(self) -> Connection:
        """The `rtc` connection, after `negotiate`; for measurements."""
        if self._connection is None:
            raise RuntimeError("call negotiate() first")
        return self._connection

    async def connect(self) -> None:
        """Connect; return when feedback can come. Raises ConnectFailed."""
        jsep = {"type": "answer", "sdp": self._answer()}
        await self._ask("message", body={"request": "start"}, jsep=jsep)
        try:
            async with asyncio.timeout(ANSWER_SECONDS):
                await self._heard.wait()
        except TimeoutError:
            raise ConnectFailed("no packet arrived from the relay: is UDP to the relay blocked?") from None

    async def run(self) -> None:
        """Keep the session and notice when the relay is gone, until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._listen_to_events())
            tasks.create_task(self._keep_alive())
            tasks.create_task(self._watch())

    async def close(self) -> None:
        """Close the connection to the relay. Idempotent."""
        self.ended.set()
        if self._endpoint is not None:
            self._endpoint.close()
        if self._socket is not None:
            try:
                await self._socket.close()
            finally:
                self._socket.transport.abort()  # websockets leaves it open when its close is cancelled

    def _answer(self) -> str:
        offer, connection = self._offer, self._connection
        if offer is None or connection is None:
            raise RuntimeError("call negotiate() first")
        media = {
            section.mid: receiving("video" if section.kind == "video" else "audio")
            for section in offer.sections
            if section.is_media
        }
        try:
            answer = connection.answer(offer, media)
            # Janus tells a subscriber of data only when the subscriber has a channel of its own.
            connection.open_channel("feedback", reliability=Reliability(ordered=False, max_retransmits=0))
        except (SdpError, PeerNotReady) as error:
            raise ConnectFailed(f"the relay's offer cannot be used: {error}") from error
        return write_description(answer)

    def _event(self, event: PeerEvent) -> None:
        if isinstance(event, ChannelMessage):
            self._heard.set()
            self._on_message(event.data)
        elif isinstance(event, PeerEnded):
            self._lose("the relay closed the connection")
        elif self.packets is not None:
            self.packets.heard(event)

    def _lose(self, why: str) -> None:
        if not self.ended.is_set():
            self.why = why
            self.ended.set()

    async def _ask(self, kind: str, **fields: Any) -> Heard:
        """Send a request and return its answer. Only before `run`, which reads later messages."""
        transaction = f"{self._prefix}-{next(self._numbers)}"
        if self._socket is None:
            raise ConnectFailed("not connected to the relay")
        try:
            async with asyncio.timeout(ANSWER_SECONDS):
                request = janus_request(kind, transaction, session_id=self._session, handle_id=self._handle, **fields)
                await self._socket.send(request)
                while True:
                    heard = parse_janus(await self._socket.recv())
                    if heard.transaction == transaction and heard.kind != "ack":
                        break
        except (TimeoutError, WebSocketException, MessageError) as error:
            raise ConnectFailed(f"the relay did not answer ({type(error).__name__})") from error
        if heard.kind == "error":
            raise ConnectFailed(f"the relay refused: {heard.detail}")
        return heard

    async def _listen_to_events(self) -> None:
        if self._socket is None:
            return
        try:
            async for text in in_turns(self._socket.recv):
                if _ends(text):
                    self._lose("the relay ended the subscription")
        except WebSocketException:
            pass  # handled below
        self._lose("the connection to the relay was closed")

    async def _keep_alive(self) -> None:
        while self._socket is not None:
            await asyncio.sleep(KEEPALIVE_SECONDS)
            text = janus_request("keepalive", f"{self._prefix}-{next(self._numbers)}", session_id=self._session)
            try:
                await self._socket.send(text)
            except WebSocketException:
                return  # the listener tells it

    async def _watch(self) -> None:
        loop = asyncio.get_running_loop()
        held_up = 0  # times in a row
        while not self.ended.is_set():
            self._heard.clear()
            due = loop.time() + SILENCE_SECONDS
            try:
                async with asyncio.timeout_at(due):
                    await self._heard.wait()
                held_up = 0
            except TimeoutError:
                # Late: this process was held up, and has not read the packets of that time yet.
                held_up = held_up + 1 if loop.time() - due >= HELD_UP_SECONDS else 0
                if not 0 < held_up <= MOST_HELD_UP:
                    self._lose(f"no message came from the relay for {SILENCE_SECONDS:g} s")


def _ends(text: str | bytes) -> bool:
    try:
        return parse_janus(text).kind == "ended"
    except MessageError:
        return False


def _identifier(heard: Heard) -> int:
    found = heard.data.get("id")
    if not isinstance(found, int):
        raise ConnectFailed("the relay's answer has no id")
    return found


def _named(sections: list[Section], data: dict[str, Any], names: dict[str, str]) -> list[Section]:
    """Return the sections with their streams' names, which Janus tells beside its offer."""
    streams = data.get("streams")
    by_mid = {
        str(each.get("mid")): names.get(str(each.get("feed_mid")), "")
        for each in (streams if isinstance(streams, list) else [])
        if isinstance(each, dict)
    }
    for section in sections:
        section.stream = by_mid.get(section.mid, "")
    return sections
