"""The bridge's side of all links: admits them, and hands their messages on."""

import asyncio
import ssl
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from lockstep.protocol.actions import Act, ActionCancel
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.link_secret import LinkSecret
from lockstep.protocol.messages import (
    Command,
    EncodeRequest,
    Goodbye,
    Hello,
    LinkMessage,
    Reset,
    Rest,
    Stop,
)
from lockstep.robot_bridge.counters import BridgeCounters
from lockstep.robot_bridge.errors import ListenError
from lockstep.robot_bridge.link.admission.applicants import Strangers
from lockstep.robot_bridge.link.admission.known_addresses import KnownAddresses
from lockstep.robot_bridge.link.admission.link_acceptor import LinkAcceptor, listening_socket
from lockstep.robot_bridge.link.admission.link_admission import LinkAdmission
from lockstep.robot_bridge.link.link_session import BadInput, BridgeSession
from lockstep.robot_bridge.link.link_transport import TICK_INTERVAL, LinkTransport
from lockstep.robot_bridge.link.message_rate import MessageRate
from lockstep.robot_bridge.link.sending.link_publisher import LinkPublisher, StreamEncoding

__all__ = ["LinkHandler", "LinkPeer", "LinkServer"]

CLOSE_TIMEOUT = 1.0  # s for goodbyes to leave when the bridge closes
READ_RATE = 500.0  # messages per second read of a link, on average; a watcher sends less than a tenth
OPERATOR_READ_RATE = 5000.0  # of the operator link, on which a console passes on the stops of many people
READ_BURST = 50.0  # messages at once: about a millisecond of the loop


GOODBYES = frozenset(
    ("handshake", "version", "role", "unauthorised", "taken", "full", "framing", "silent", "closing", "lost")
)  # names that are counted; docs/robot-link.md, "Goodbyes"


class LinkHandler(Protocol):
    """The part of the bridge that the server calls. All methods return at once."""

    def link_opened(self, peer: "LinkPeer") -> None:
        """A link was admitted; its hello is on the way."""

    def link_message(self, peer: "LinkPeer", message: Command | Rest | Stop | Reset | Act | ActionCancel) -> None:
        """A valid message came that the link's role permits."""

    def link_bad_input(self, peer: "LinkPeer", bad: BadInput) -> None:
        """Bad input came on a link that lives on; it is counted already."""

    def operator_lost(self) -> None:
        """The operator link ended, for any reason."""


class EncodingSide(StreamEncoding, Protocol):
    """The part of a bridge that encodes media and is asked how. All methods return at once."""

    codecs: tuple[str, ...]
    encodings: int  # of a camera, at most

    def joined(self, link: object) -> None:
        """A media link was admitted."""

    def asked(self, link: object, request: EncodeRequest) -> None:
        """A media link says what it wants."""

    def left(self, link: object) -> None:
        """A link ended, admitted or not."""


class LinkPeer(LinkTransport):
    """A link that is admitted or asks to be."""

    def __init__(
        self, server: "LinkServer", clock: Callable[[], float], secret: LinkSecret | None, *, dialled: bool = False
    ) -> None:
        """`dialled`: this bridge opened the connection."""
        now = clock()
        self.dialled = dialled
        self.admitted = asyncio.Event()  # set once, and stays set after the end
        session = BridgeSession(now, self._admit, secret)
        self._reads = MessageRate(READ_RATE, READ_BURST, now)
        super().__init__(session, clock, self._reads)
        self._bridge_session = session
        self._server = server
        self.name = ""  # the client's own name, "console"
        self.address = ""  # the client's address, "10.0.0.9"

    def _admit(self, hello: Hello) -> Hello | Goodbye:
        self.name = hello.name
        answer = self._server.admit(self, hello)
        if isinstance(answer, Hello):
            self.admitted.set()
            if hello.role == "operator":
                self._reads.rate = OPERATOR_READ_RATE
        return answer

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        address = transport.get_extra_info("peername")
        self.address = str(address[0]) if address else ""
        self._server.connected(self)

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self._bridge_session.challenged:
            self._server.challenged(self)

    def received(self, event: LinkMessage | BadInput) -> None:
        self._server.received(self, event)

    def lost(self) -> None:
        self._server.ended(self)

    def connection_lost(self, error: Exception | None) -> None:
        super().connection_lost(error)
        self._server.disconnected(self)


class LinkServer:
    """Owns the listening socket, if there is one, and every link. `run` accepts links and keeps them alive.

    Attributes:
        publisher: sends to the admitted links
    """

    def __init__(
        self,
        handler: LinkHandler,
        description: RobotDescription,
        epoch: str,
        counters: BridgeCounters,
        *,
        max_links: int,
        max_strangers: int,
        operator_grace: float = 0.0,
        addresses_file: Path | None = None,
        secret: LinkSecret | None = None,
        tls: ssl.SSLContext | None = None,
        encoding: EncodingSide | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`encoding`: hears what media links ask for; None: media are sent as they are, and requests are ignored."""
        self._handler = handler
        self._encoding = encoding
        self._hello = Hello(
            role="robot",
            name=description.name,
            epoch=epoch,
            description=description,
            encodes=[] if encoding is None else list(encoding.codecs),
            encodings=1 if encoding is None else encoding.encodings,
        )
        self._counters = counters
        self._max_strangers = max_strangers
        self._addresses = KnownAddresses(addresses_file)
        self._secret = secret
        self._tls = tls
        self._clock = clock
        self._connections: set[LinkPeer] = set()  # all sockets, those that are closing included
        self._strangers: Strangers[LinkPeer] = Strangers(max_strangers)
        self._admitted: LinkAdmission[LinkTransport] = LinkAdmission(max_links=max_links, operator_grace=operator_grace)
        self.publisher = LinkPublisher(self._admitted, encoding)
        self._acceptor: LinkAcceptor | None = None  # None while it does not listen
        self._closed = False
        self._all_gone = asyncio.Event()

    @property
    def links(self) -> int:
        """The number of open sockets."""
        return len(self._connections)

    async def listen(self, host: str, port: int) -> tuple[str, int]:
        """Listen, and return the address.

        Raises:
            ListenError: the address cannot be had.
        """
        await asyncio.to_thread(self._addresses.read)
        try:
            listener = await asyncio.to_thread(listening_socket, host, port)  # may look up a name
        except OSError as error:
            raise ListenError(f"cannot listen on {host}:{port}: {error}") from error
        address = listener.getsockname()
        self._acceptor = LinkAcceptor(
            listener,
            self._tls,
            factory=lambda: LinkPeer(self, self._clock, self._secret),
            failed=lambda: self._counters.bad_input.update(["tls"]),
            max_handshakes=self._max_strangers,
            known=self._addresses,
        )
        return str(address[0]), int(address[1])

    def dialled_link(self, secret: LinkSecret) -> LinkPeer:
        """Return a link for a connection that the bridge itself has opened, to the console with this secret."""
        return LinkPeer(self, self._clock, secret, dialled=True)

    async def run(self) -> None:
        """Accept links until `close`, and run the heartbeats until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            if self._acceptor is not None:
                tasks.create_task(self._acceptor.run())
            while True:
                await asyncio.sleep(TICK_INTERVAL)
                for peer in list(self._connections):
                    peer.tick()

    async def close(self, reason: str = "the bridge is closing") -> None:
        """Stop listening, say goodbye to all with this reason, and wait until they are gone."""
        self._closed = True
        acceptor, self._acceptor = self._acceptor, None
        if acceptor is not None:
            await acceptor.close()
        for peer in list(self._connections):
            peer.end("closing", reason)
        try:
            async with asyncio.timeout(CLOSE_TIMEOUT):
                while self._connections:
                    self._all_gone.clear()
                    await self._all_gone.wait()
        except TimeoutError:
            for peer in list(self._connections):
                peer.abort()

    def drops(self) -> Counter[str]:
        """Return the messages that slow links have missed, ended links included."""
        return sum((peer.output.drops for peer in self._connections), self._counters.drops)

    # called by the links

    def admit(self, peer: LinkPeer, hello: Hello) -> Hello | Goodbye:
        """Admit or refuse a link, after its peer has proven the secret if there is one."""
        refused = self._admitted.refuses(hello, self._clock())
        if refused is not None:
            return refused
        self._strangers.forget(peer)
        self._admitted.add(peer, hello)
        if self._acceptor is not None and not peer.dialled:
            self._acceptor.admitted(peer.address)
        if hello.role == "events":
            return Hello(role="robot", name=self._hello.name, epoch=self._hello.epoch)
        if hello.role == "media" and self._encoding is not None:
            peer.output.keep_little()
            self._encoding.joined(peer)
        return self._hello

    def connected(self, peer: LinkPeer) -> None:
        self._connections.add(peer)
        if self._closed:
            peer.end("closing", "the bridge is closing")
        else:
            self._end_surplus(self._strangers.silent(peer, peer.address))

    def challenged(self, peer: LinkPeer) -> None:
        """Note that a peer has said a proper hello and owes the proof."""
        self._end_surplus(self._strangers.challenged(peer, peer.address))

    def _end_surplus(self, gone: LinkPeer | None) -> None:
        if gone is not None:
            gone.end("full", "too many connections that have not been admitted")

    def received(self, peer: LinkPeer, event: LinkMessage | BadInput) -> None:
        match event:
            case BadInput():
                self._counters.bad_input[event.name] += 1
                if peer.session.ended is None:
                    self._handler.link_bad_input(peer, event)
            case Hello():
                self._handler.link_opened(peer)
                self.publisher.link_opened(peer)
            case EncodeRequest():
                if self._encoding is not None:
                    self._encoding.asked(peer, event)
            case Command() | Rest() | Stop() | Reset() | Act() | ActionCancel():
                self._handler.link_message(peer, event)
            case _:
                raise AssertionError(f"the session let {type(event).__name__} through")

    def ended(self, peer: LinkPeer) -> None:
        if peer.session.ended is not None:
            error = peer.session.ended.error  # the peer may have made it up
            self._counters.endings[error if error in GOODBYES else "other"] += 1
        self._strangers.forget(peer)
        if self._encoding is not None:
            self._encoding.left(peer)
        if self._admitted.remove(peer, peer.name, self._clock(), left=peer.session.left):
            self._handler.operator_lost()

    def disconnected(self, peer: LinkPeer) -> None:
        self._connections.discard(peer)
        self._counters.drops.update(peer.output.drops)
        self._all_gone.set()
