"""The session of one robot link connection, on either side. No I/O, no clock (docs/robot-link.md, "Connections").

Call order: `receive` with bytes as they come, `tick` every 50 ms or so, `end` to say goodbye; after each of them send
the messages that `take_outgoing` returns and, once `ended` is set, close. An ended session stays ended.
"""

from collections.abc import Callable, Generator
from contextlib import closing
from enum import Enum
from typing import Literal, NamedTuple

import msgspec

from lockstep.protocol.actions import (
    MAX_STATUS_BYTES,
    Act,
    ActionCancel,
    ActionUpdate,
    Status,
    fits_kind,
    status_item_bytes,
)
from lockstep.protocol.errors import FramingError, MessageError
from lockstep.protocol.framing import MAX_CONTROL_FRAME, MAX_HELLO_FRAME, MAX_MEDIA_FRAME, FrameReader
from lockstep.protocol.link_secret import NONCE_BYTES, LinkSecret, draw_nonce
from lockstep.protocol.maps import MAX_CELLS, Navigation, OccupancyMap
from lockstep.protocol.messages import (
    PROTOCOL_VERSION,
    Challenge,
    Command,
    EncodeRequest,
    EventNotice,
    Feedback,
    Goodbye,
    Hello,
    LinkMessage,
    LinkRole,
    Media,
    Ping,
    Pong,
    Refusal,
    Reset,
    Rest,
    Stop,
    StopTaken,
    decode_message,
)
from lockstep.robot_bridge.control.feedback_fit import misfit
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.errors import DescriptionError
from lockstep.robot_bridge.link.asking import Asking
from lockstep.robot_bridge.link.heartbeats import Heartbeats
from lockstep.robot_bridge.link.message_rate import MessageRate

__all__ = ["BadInput", "BridgeSession", "ClientSession", "LinkSession", "LinkState", "kind_of"]

HELLO_TIMEOUT = 2.0  # s
OWN_STALL = 0.5  # s between two ticks; more means that this side did not look, not that the other side was silent

FROM_CLIENT: dict[LinkRole, tuple[type[LinkMessage], ...]] = {
    "operator": (Command, Rest, Stop, Reset, Act, ActionCancel),
    "events": (Stop,),
    "media": (Stop, EncodeRequest),
}
FROM_ROBOT: dict[LinkRole, tuple[type[LinkMessage], ...]] = {
    "operator": (Feedback, Refusal, StopTaken, ActionUpdate, Status, Navigation),
    "events": (EventNotice, Refusal, StopTaken),
    "media": (Media, OccupancyMap, Refusal, StopTaken),
}


class LinkState(Enum):
    HANDSHAKE = "handshake"
    OPEN = "open"
    ENDED = "ended"


class BadInput(NamedTuple):
    """Something that the other side should not have sent; it counts only as bad input, not as a sign of life."""

    name: Literal["malformed", "not_allowed", "framing", "handshake", "unauthorised"]
    detail: str
    event: int = 0  # of the command that was not allowed; 0 otherwise


class LinkSession:
    """The common part of both sides: frames, permissions, heartbeats, silence."""

    def __init__(self, now: float, *, max_frame: int) -> None:
        self.state = LinkState.HANDSHAKE
        self.role: LinkRole | None = None  # the client's role; None before it is known
        self.ended: Goodbye | None = None  # the goodbye that ended it, from either side; None while it lives
        self.left = False  # the other side ended it because it goes away
        self._reader = FrameReader(max_frame)
        self._allowed: tuple[type[LinkMessage], ...] = ()
        self._outgoing: list[LinkMessage] = []
        self._opened = now
        self._last_valid = now
        self._last_tick = now
        self._heartbeats = Heartbeats(now)

    @property
    def patience(self) -> float:
        """The seconds of silence after which the other side is taken for dead."""
        return self._heartbeats.patience

    @property
    def missing(self) -> int:
        """The bytes that a large message still needs; 0 if none is on its way."""
        return self._reader.missing

    @property
    def waits(self) -> bool:
        """True if received bytes were not read because `rate` was used up: call `receive` again later."""
        return self.ended is None and self._reader.has_frame

    def receive(self, data: bytes, now: float, rate: MessageRate | None = None) -> list[LinkMessage | BadInput]:
        """Return the messages in these bytes, in order; heartbeats are answered here and not returned.

        `rate`: messages beyond it wait; None: no bound.
        """
        events: list[LinkMessage | BadInput] = []
        self._reader.feed(data)
        with closing(self._reader.frames()) as frames:
            self._read(frames, events, now, rate)
        return events

    def _read(
        self,
        frames: Generator[bytes | bytearray],
        events: list[LinkMessage | BadInput],
        now: float,
        rate: MessageRate | None,
    ) -> None:
        while self.ended is None and (rate is None or rate.left):
            try:
                payload = next(frames, None)
            except FramingError as error:
                events.append(BadInput("framing", error.detail))
                self.end("framing", error.detail)
                break
            if payload is None:
                break
            if rate is not None:
                rate.spend(len(payload))
            event = self._receive_frame(payload, now)
            if event is not None:
                events.append(event)

    def _receive_frame(self, payload: bytes | bytearray, now: float) -> LinkMessage | BadInput | None:
        try:
            message = decode_message(payload)
        except MessageError as error:
            if self.state is LinkState.HANDSHAKE:
                self.end("handshake", error.detail)
            return BadInput("malformed", error.detail)
        if self.state is LinkState.HANDSHAKE:
            return self._shake_hands(message, now)
        return self._receive_open(message, now)

    def _receive_open(self, message: LinkMessage, now: float) -> LinkMessage | BadInput | None:
        match message:
            case Ping(id=number):
                self._last_valid = now
                self._outgoing.append(Pong(id=number))
                return None
            case Pong(id=number):
                self._last_valid = now
                self._heartbeats.pong(number, now)
                return None
            case Goodbye():
                self.left = message.error == "closing"
                self._finish(message)
                return None
        if isinstance(message, self._allowed):
            self._last_valid = now
            return message
        event = message.event if isinstance(message, Command) else 0
        return BadInput("not_allowed", f"{kind_of(message)} on a link of role {self.role}", event)

    def _shake_hands(self, message: LinkMessage, now: float) -> LinkMessage | BadInput | None:
        raise NotImplementedError

    def _open(self, role: LinkRole, allowed: tuple[type[LinkMessage], ...], now: float) -> None:
        self.role, self._allowed, self._last_valid = role, allowed, now
        self.state = LinkState.OPEN

    def tick(self, now: float) -> None:
        """Send heartbeats that are due; end a silent session."""
        gap, self._last_tick = now - self._last_tick, now
        if gap > OWN_STALL:
            self._last_valid = min(now, self._last_valid + gap)
            self._opened += gap
        if self.ended is not None:
            return
        if self.state is LinkState.HANDSHAKE:
            if now - self._opened > HELLO_TIMEOUT:
                self.end("silent", f"no hello within {HELLO_TIMEOUT:g} s")
        elif now - self._last_valid > self.patience:
            self.end("silent", f"nothing valid received for {self.patience:.1f} s")
        elif (ping := self._heartbeats.ping(now)) is not None:
            self._outgoing.append(ping)

    def end(self, error: str, detail: str = "") -> None:
        """Say goodbye; nothing is received afterwards."""
        if self.ended is None:
            goodbye = Goodbye(error=error, detail=detail[:500])
            self._outgoing.append(goodbye)
            self._finish(goodbye)

    def lose(self, detail: str) -> None:
        """End the session because the connection ended without a goodbye."""
        if self.ended is None:
            self._finish(Goodbye(error="lost", detail=detail[:500]))

    def _finish(self, goodbye: Goodbye) -> None:
        self.ended = goodbye
        self.state = LinkState.ENDED

    def take_outgoing(self) -> list[LinkMessage]:
        """Return the messages to send, in order; each is returned once."""
        outgoing, self._outgoing = self._outgoing, []
        return outgoing


class BridgeSession(LinkSession):
    """The bridge's side. `admit` answers a hello of a known version and role with the bridge's hello or a goodbye.

    With a secret, `admit` is called only for clients that have proven to know it.
    """

    def __init__(self, now: float, admit: Callable[[Hello], Hello | Goodbye], secret: LinkSecret | None = None) -> None:
        super().__init__(now, max_frame=MAX_HELLO_FRAME)
        self._admit = admit
        self._secret = secret
        self._challenged: Hello | None = None  # the hello that was answered with a challenge
        self._challenged_at = now
        self._nonce = b""  # of that challenge

    @property
    def challenged(self) -> bool:
        """True if the client has said a proper hello and owes the proof."""
        return self._challenged is not None and self.state is LinkState.HANDSHAKE

    def _shake_hands(self, message: LinkMessage, now: float) -> LinkMessage | BadInput | None:
        """Return the hello if it was admitted."""
        if not isinstance(message, Hello):
            return self._reject("handshake", f"the first message must be hello, not {kind_of(message)}")
        if message.version != PROTOCOL_VERSION:
            return self._reject("version", f"this bridge speaks version {PROTOCOL_VERSION}, not {message.version}")
        if message.role not in FROM_CLIENT:
            return self._reject("role", f"a client cannot have the role {message.role}")
        if self._secret is None:
            return self._open_for(message, b"", now)
        if self._challenged is None:
            return self._challenge(message, now)
        self._heartbeats.measured(now - self._challenged_at)
        return self._check(message, self._challenged, self._secret, now)

    def _challenge(self, hello: Hello, now: float) -> BadInput | None:
        if len(hello.nonce) != NONCE_BYTES:
            return self._reject("unauthorised", "this bridge asks for the link secret")
        self._challenged, self._challenged_at, self._nonce = hello, now, draw_nonce()
        self._outgoing.append(Challenge(nonce=self._nonce))
        return None

    def _check(self, hello: Hello, first: Hello, secret: LinkSecret, now: float) -> LinkMessage | BadInput | None:
        proof = secret.client_proof(first.nonce, self._nonce, first.role)
        if not LinkSecret.same(hello.proof, proof) or (hello.role, hello.nonce) != (first.role, first.nonce):
            return self._reject("unauthorised", "wrong link secret")
        return self._open_for(hello, first.nonce, now)

    def _open_for(self, hello: Hello, client_nonce: bytes, now: float) -> LinkMessage | None:
        answer = self._admit(hello)
        if isinstance(answer, Goodbye):
            self.end(answer.error, answer.detail)
            return None
        if self._secret is not None:
            proof = self._secret.bridge_proof(client_nonce, self._nonce, answer.epoch)
            answer = msgspec.structs.replace(answer, proof=proof)
        self._open(hello.role, FROM_CLIENT[hello.role], now)
        self._reader.max_frame = MAX_CONTROL_FRAME
        self._outgoing.append(answer)
        return hello

    def _reject(self, error: str, detail: str) -> BadInput:
        self.end(error, detail)
        return BadInput("unauthorised" if error == "unauthorised" else "handshake", detail)


class ClientSession(LinkSession):
    """The client's side: sends its hello at once and returns the bridge's.

    With a secret it goes on only with a bridge that has proven to know it too.
    """

    def __init__(self, now: float, role: LinkRole, name: str = "", secret: LinkSecret | None = None) -> None:
        super().__init__(now, max_frame=MAX_CONTROL_FRAME)
        if role not in FROM_ROBOT:
            raise ValueError(f"a client cannot have the role {role}")
        self.role = role
        self.hello: Hello | None = None  # the bridge's; None before the handshake
        self._secret = secret
        self._bridge_nonce: bytes | None = None  # None before a challenge
        self._said = Hello(role=role, name=name, nonce=b"" if secret is None else draw_nonce())
        self._outgoing.append(self._said)
        self._asking = Asking()

    @property
    def asks_at(self) -> float | None:
        """When `tick` is to be called next to ask for an answer that is due, s; None: for none."""
        return None if self.ended is not None else self._asking.at

    def sent(self, message: LinkMessage, now: float) -> None:
        """Take note of a message that was sent: an answer to it may be due."""
        self._asking.sent(message, now)

    def tick(self, now: float) -> None:
        super().tick(now)
        if self.asks_at is not None and now >= self.asks_at:
            self._asking.asked(now)
            if not any(isinstance(message, Ping) for message in self._outgoing):
                self._outgoing.append(self._heartbeats.ping_early(now))

    def _shake_hands(self, message: LinkMessage, now: float) -> LinkMessage | BadInput | None:
        if isinstance(message, Goodbye):
            self._finish(message)
            return None
        if isinstance(message, Challenge):
            return self._answer(message)
        if not isinstance(message, Hello):
            return self._reject("handshake", f"expected hello, not {kind_of(message)}")
        if message.version != PROTOCOL_VERSION or message.role != "robot" or not message.epoch:
            return self._reject("version", f"not a bridge of version {PROTOCOL_VERSION}")
        if self.role != "events" and message.description is None:
            return self._reject("handshake", "the bridge sent no description")
        if not self._is_proven(message):
            return self._reject("unauthorised", "the bridge does not prove that it knows the link secret")
        try:
            if message.description is not None:
                check_description(message.description)
        except DescriptionError as error:
            return self._reject("description", f"the bridge's description is invalid: {error}")
        assert self.role is not None  # set by __init__
        self._heartbeats.measured(now - self._opened)
        self._open(self.role, FROM_ROBOT[self.role], now)
        self._reader.max_frame = MAX_MEDIA_FRAME if self.role == "media" else MAX_CONTROL_FRAME
        self.hello = message
        return message

    def _receive_open(self, message: LinkMessage, now: float) -> LinkMessage | BadInput | None:
        """Refuse a feedback, status, map or navigation that does not fit as bad input: no part could show it."""
        if isinstance(message, Status) and isinstance(message, self._allowed):
            if not all(map(fits_kind, message.items)):
                return BadInput("malformed", "a status item whose value is not of its kind")
            if sum(map(status_item_bytes, message.items)) > MAX_STATUS_BYTES:
                return BadInput("malformed", f"a status of more than {MAX_STATUS_BYTES} bytes")
        if isinstance(message, OccupancyMap) and message.width * message.height > MAX_CELLS:
            return BadInput("malformed", f"a map of more than {MAX_CELLS} cells")
        if isinstance(message, Navigation) and (len(message.goal) not in (0, 3) or len(message.path) % 2):
            return BadInput("malformed", "a goal or a path that is no pose or no points")
        described = None if self.hello is None else self.hello.description
        if isinstance(message, Feedback) and isinstance(message, self._allowed) and described is not None:
            wrong = misfit(message, described)
            if wrong:
                return BadInput("malformed", wrong)
        if isinstance(message, self._allowed):
            self._asking.received(message, now)
        return super()._receive_open(message, now)

    def _answer(self, challenge: Challenge) -> BadInput | None:
        if self._secret is None:
            return self._reject("unauthorised", "the bridge asks for the link secret")
        if self._bridge_nonce is not None or len(challenge.nonce) != NONCE_BYTES:
            return self._reject("handshake", "not a challenge of this protocol")
        self._bridge_nonce = challenge.nonce
        proof = self._secret.client_proof(self._said.nonce, challenge.nonce, self._said.role)
        self._outgoing.append(msgspec.structs.replace(self._said, proof=proof))
        return None

    def _is_proven(self, hello: Hello) -> bool:
        """Return whether the bridge has proven the secret. Without a secret no proof is needed.

        With a secret, a bridge that did not ask for it is refused too.
        """
        if self._secret is None:
            return True
        if self._bridge_nonce is None:
            return False
        proof = self._secret.bridge_proof(self._said.nonce, self._bridge_nonce, hello.epoch)
        return LinkSecret.same(hello.proof, proof)

    def _reject(self, error: str, detail: str) -> BadInput:
        self.end(error, detail)
        return BadInput("unauthorised" if error == "unauthorised" else "handshake", detail)


def kind_of(message: LinkMessage) -> str:
    """Return the `type` of the message on the wire."""
    return str(message.__struct_config__.tag)
