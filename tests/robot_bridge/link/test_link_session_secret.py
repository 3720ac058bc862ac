"""The handshake with a secret, without sockets: both sides prove it, nothing can be replayed, nobody is downgraded."""

import msgspec
import pytest

from lockstep.protocol.framing import MAX_HELLO_FRAME, frame
from lockstep.protocol.link_secret import LinkSecret, draw_nonce
from lockstep.protocol.messages import (
    Challenge,
    Command,
    Goodbye,
    Hello,
    LinkMessage,
    LinkRole,
    Ping,
    Stop,
    encode_message,
)
from lockstep.robot_bridge.link.link_session import BadInput, BridgeSession, ClientSession, LinkState
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION

SECRET = LinkSecret.draw()
OTHER = LinkSecret.draw()
ANSWER = Hello(role="robot", epoch="e1", description=DESCRIPTION)


def wire(*messages: LinkMessage) -> bytes:
    return b"".join(frame(encode_message(message)) for message in messages)


class Pair:
    """Both ends; `run` exchanges messages until both have nothing more to say."""

    def __init__(self, client: LinkSecret | None, bridge: LinkSecret | None, role: LinkRole = "operator") -> None:
        self.admitted: list[Hello] = []
        self.client = ClientSession(0.0, role, "test", client)
        self.bridge = BridgeSession(0.0, self.admit, bridge)
        self.said: list[LinkMessage] = []  # by the client
        self.answered: list[LinkMessage] = []  # by the bridge
        self.bad: list[BadInput] = []

    def admit(self, hello: Hello) -> Hello | Goodbye:
        self.admitted.append(hello)
        return ANSWER

    def run(self) -> "Pair":
        while True:
            said, answered = self.client.take_outgoing(), self.bridge.take_outgoing()
            if not said and not answered:
                return self
            self.said += said
            self.answered += answered
            events = self.bridge.receive(wire(*said), 0.0) + self.client.receive(wire(*answered), 0.0)
            self.bad += [event for event in events if isinstance(event, BadInput)]


@pytest.mark.parametrize("role", ["operator", "events", "media"])
def test_who_knows_the_secret_is_let_in_and_the_secret_is_never_sent(role: LinkRole) -> None:
    pair = Pair(SECRET, SECRET, role).run()
    assert pair.client.state is pair.bridge.state is LinkState.OPEN
    assert len(pair.admitted) == 1
    sent = wire(*pair.said, *pair.answered)
    assert SECRET.reveal().encode() not in sent


@pytest.mark.parametrize(("client", "bridge"), [(OTHER, SECRET), (None, SECRET)])
def test_who_does_not_know_the_secret_is_unauthorised_and_never_admitted(
    client: LinkSecret | None, bridge: LinkSecret
) -> None:
    pair = Pair(client, bridge).run()
    assert pair.bridge.ended is not None
    assert pair.bridge.ended.error == "unauthorised"
    assert pair.client.ended is not None
    assert pair.client.ended.error == "unauthorised"
    assert [bad.name for bad in pair.bad] == ["unauthorised"]
    assert pair.admitted == []


def test_a_client_with_a_secret_goes_on_with_no_bridge_that_asks_for_none() -> None:
    pair = Pair(SECRET, None).run()
    assert pair.client.ended is not None
    assert pair.client.ended.error == "unauthorised"
    assert pair.client.hello is None


def test_a_client_without_a_secret_and_a_bridge_without_one_need_none() -> None:
    pair = Pair(None, None).run()
    assert pair.client.state is LinkState.OPEN
    assert not any(isinstance(message, Challenge) for message in pair.answered)


def test_what_was_said_in_one_handshake_is_worth_nothing_in_another() -> None:
    recorded = Pair(SECRET, SECRET).run()
    replayed = Pair(None, SECRET)
    bad = replayed.bridge.receive(wire(*recorded.said), 0.0)
    assert [type(event) for event in bad] == [BadInput]
    assert replayed.bridge.ended is not None
    assert replayed.bridge.ended.error == "unauthorised"
    client = ClientSession(0.0, "operator", "test", SECRET)
    client.take_outgoing()
    client.receive(wire(*recorded.answered), 0.0)
    assert client.ended is not None
    assert client.ended.error == "unauthorised"


def test_a_proof_for_one_role_opens_no_other() -> None:
    bridge = BridgeSession(0.0, lambda _: ANSWER, SECRET)
    nonce = draw_nonce()
    bridge.receive(wire(Hello(role="media", nonce=nonce)), 0.0)
    (challenge,) = bridge.take_outgoing()
    assert isinstance(challenge, Challenge)
    proof = SECRET.client_proof(nonce, challenge.nonce, "media")
    bridge.receive(wire(Hello(role="operator", nonce=nonce, proof=proof)), 0.0)
    assert bridge.ended is not None
    assert bridge.ended.error == "unauthorised"


def test_there_is_one_try_per_connection() -> None:
    bridge = BridgeSession(0.0, lambda _: ANSWER, SECRET)
    nonce = draw_nonce()
    first = Hello(role="operator", nonce=nonce)
    bridge.receive(wire(first), 0.0)
    (challenge,) = bridge.take_outgoing()
    assert isinstance(challenge, Challenge)
    good = msgspec.structs.replace(first, proof=SECRET.client_proof(nonce, challenge.nonce, "operator"))
    bridge.receive(wire(msgspec.structs.replace(first, proof=b"\0" * 32), good), 0.0)
    assert bridge.state is LinkState.ENDED


@pytest.mark.parametrize(
    "message", [Stop(), Ping(id=1), Command(event=2, issue=1, values=[1.0]), Challenge(nonce=b"\0" * 32)]
)
def test_before_the_proof_nothing_is_taken_but_hello(message: LinkMessage) -> None:
    bridge = BridgeSession(0.0, lambda _: ANSWER, SECRET)
    bridge.receive(wire(Hello(role="operator", nonce=draw_nonce())), 0.0)
    events = bridge.receive(wire(message), 0.0)
    assert [type(event) for event in events] == [BadInput]
    assert bridge.state is LinkState.ENDED


def test_before_the_proof_no_long_frame_is_waited_for_and_afterwards_it_is() -> None:
    long = (MAX_HELLO_FRAME + 1).to_bytes(4, "big")
    stranger = BridgeSession(0.0, lambda _: ANSWER, SECRET)
    (bad,) = stranger.receive(long, 0.0)
    assert isinstance(bad, BadInput)
    assert bad.name == "framing"
    pair = Pair(SECRET, SECRET).run()
    assert pair.bridge.receive(long, 0.0) == []
    assert pair.bridge.state is LinkState.OPEN


def test_a_challenged_client_that_says_nothing_more_is_silent() -> None:
    bridge = BridgeSession(0.0, lambda _: ANSWER, SECRET)
    bridge.receive(wire(Hello(role="operator", nonce=draw_nonce())), 0.0)
    for tick in range(50):
        bridge.tick(tick * 0.05)
    assert bridge.ended is not None
    assert bridge.ended.error == "silent"


@pytest.mark.parametrize(
    "challenges", [[Challenge(nonce=b"short")], [Challenge(nonce=b"\0" * 32), Challenge(nonce=b"\1" * 32)]]
)
def test_a_client_answers_one_well_formed_challenge(challenges: list[LinkMessage]) -> None:
    client = ClientSession(0.0, "operator", "test", SECRET)
    client.receive(wire(*challenges), 0.0)
    assert client.ended is not None
    assert client.ended.error == "handshake"
