import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.actions import MAX_STATUS_BYTES, MAX_STATUS_ITEMS, Status, StatusItem
from lockstep.protocol.framing import MAX_CONTROL_FRAME, frame
from lockstep.protocol.messages import (
    Command,
    EventNotice,
    Feedback,
    Goodbye,
    Hello,
    LinkMessage,
    LinkRole,
    Media,
    Ping,
    Pong,
    Reset,
    Rest,
    Stop,
    encode_message,
)
from lockstep.robot_bridge.link.heartbeats import PING_INTERVAL, SILENCE
from lockstep.robot_bridge.link.link_session import (
    FROM_CLIENT,
    FROM_ROBOT,
    HELLO_TIMEOUT,
    BadInput,
    BridgeSession,
    ClientSession,
    LinkSession,
    LinkState,
)
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION
from tests.protocol.strategies import link_messages, mutated

ROLES: list[LinkRole] = ["operator", "events", "media"]
ANSWER = Hello(role="robot", epoch="e1", description=DESCRIPTION)
TICK = 0.05


def wire(*messages: LinkMessage) -> bytes:
    return b"".join(frame(encode_message(message)) for message in messages)


def admit(hello: Hello) -> Hello | Goodbye:
    return ANSWER


def open_pair(role: LinkRole = "operator") -> tuple[BridgeSession, ClientSession]:
    """Both sides after the handshake at time 0."""
    bridge, client = BridgeSession(0.0, admit), ClientSession(0.0, role, "test")
    exchange(client, bridge, 0.0)
    exchange(bridge, client, 0.0)
    assert bridge.state is client.state is LinkState.OPEN
    return bridge, client


def exchange(sender: LinkSession, receiver: LinkSession, now: float) -> list[LinkMessage | BadInput]:
    return receiver.receive(wire(*sender.take_outgoing()), now)


def pass_time(session: LinkSession, start: float, end: float) -> list[LinkMessage]:
    """Tick through the time; what the session sent."""
    sent: list[LinkMessage] = []
    for index in range(1, round((end - start) / TICK) + 1):
        session.tick(start + index * TICK)
        sent += session.take_outgoing()
    return sent


def is_over(session: LinkSession) -> bool:
    return session.ended is not None


@pytest.mark.parametrize("role", ROLES)
def test_the_handshake_tells_each_side_who_the_other_is(role: LinkRole) -> None:
    bridge, client = open_pair(role)
    assert bridge.role == client.role == role
    assert client.hello == ANSWER


def test_the_bridge_returns_the_hello_it_admitted() -> None:
    bridge = BridgeSession(0.0, admit)
    hello = Hello(role="operator", name="console")
    assert bridge.receive(wire(hello), 0.0) == [hello]
    assert bridge.take_outgoing() == [ANSWER]


def test_a_bridge_that_does_not_admit_says_why_and_ends() -> None:
    bridge = BridgeSession(0.0, lambda hello: Goodbye(error="taken", detail="somebody drives"))
    client = ClientSession(0.0, "operator")
    assert exchange(client, bridge, 0.0) == []
    assert exchange(bridge, client, 0.0) == []
    assert bridge.ended == client.ended == Goodbye(error="taken", detail="somebody drives")
    assert client.hello is None


@pytest.mark.parametrize(
    ("first", "error"),
    [
        (Ping(id=1), "handshake"),
        (Stop(), "handshake"),
        (Command(event=2, issue=1, values=[]), "handshake"),
        (Hello(role="operator", version=1), "version"),
        (Hello(role="robot"), "role"),
    ],
)
def test_a_wrong_first_message_ends_the_link_with_the_reason(first: LinkMessage, error: str) -> None:
    bridge = BridgeSession(0.0, admit)
    (bad,) = bridge.receive(wire(first), 0.0)
    assert isinstance(bad, BadInput)
    (goodbye,) = bridge.take_outgoing()
    assert isinstance(goodbye, Goodbye)
    assert goodbye.error == error
    assert bridge.state is LinkState.ENDED


def test_garbage_instead_of_a_hello_ends_the_link() -> None:
    bridge = BridgeSession(0.0, admit)
    (bad,) = bridge.receive(frame(b"GET / HTTP/1.1"), 0.0)
    assert isinstance(bad, BadInput)
    assert bad.name == "malformed"
    assert bridge.ended is not None


@pytest.mark.parametrize(
    "answer",
    [
        Ping(id=1),
        Hello(role="robot", epoch="e1"),
        Hello(role="robot", epoch="", description=DESCRIPTION),
        Hello(role="operator", epoch="e1", description=DESCRIPTION),
        Hello(role="robot", epoch="e1", description=DESCRIPTION, version=9),
    ],
)
def test_a_client_ends_when_the_answer_is_not_a_bridges_hello(answer: LinkMessage) -> None:
    client = ClientSession(0.0, "operator")
    (bad,) = client.receive(wire(answer), 0.0)
    assert isinstance(bad, BadInput)
    assert client.ended is not None


def test_an_event_client_needs_no_description() -> None:
    client = ClientSession(0.0, "events")
    client.receive(wire(Hello(role="robot", epoch="e1")), 0.0)
    assert client.state is LinkState.OPEN


def test_nobody_can_be_a_robot_as_a_client() -> None:
    with pytest.raises(ValueError, match="role robot"):
        ClientSession(0.0, "robot")


def test_without_a_hello_in_time_the_bridge_says_silent() -> None:
    bridge = BridgeSession(0.0, admit)
    assert pass_time(bridge, 0.0, HELLO_TIMEOUT) == []
    (goodbye,) = pass_time(bridge, HELLO_TIMEOUT, HELLO_TIMEOUT + 0.1)
    assert isinstance(goodbye, Goodbye)
    assert goodbye.error == "silent"


ONE_OF_EACH: list[LinkMessage] = [
    Command(event=2, issue=1, values=[0.0]),
    Rest(event=2),
    Stop(),
    Reset(),
    Feedback(event=1, issue=1, time=0.0, axes=[0.0] * len(DESCRIPTION.axes), joints=[0.0] * len(DESCRIPTION.joints)),
    EventNotice(event=1, time=0.0),
    Media(stream="a", codec="mjpeg", stamp=1, time=0.0, payload=b""),
    Hello(role="operator"),
]


@pytest.mark.parametrize("role", ROLES)
@pytest.mark.parametrize("message", ONE_OF_EACH, ids=lambda message: type(message).__name__)
def test_each_side_takes_only_what_the_role_permits(role: LinkRole, message: LinkMessage) -> None:
    bridge, client = open_pair(role)
    for session, allowed in ((bridge, FROM_CLIENT[role]), (client, FROM_ROBOT[role])):
        (event,) = session.receive(wire(message), 0.5)
        if isinstance(message, allowed):
            assert event == message
        else:
            assert isinstance(event, BadInput)
            assert event.name == "not_allowed"
        assert session.state is LinkState.OPEN


def test_a_stop_is_taken_from_every_role() -> None:
    assert all(Stop in kinds for kinds in FROM_CLIENT.values())


def test_a_command_that_is_not_allowed_is_reported_with_its_event() -> None:
    bridge, _ = open_pair("media")
    (bad,) = bridge.receive(wire(Command(event=9, issue=1, values=[])), 0.0)
    assert bad == BadInput("not_allowed", "command on a link of role media", 9)


@pytest.mark.parametrize("side", [0, 1])
def test_a_ping_is_answered_with_its_number(side: int) -> None:
    session = open_pair()[side]
    assert session.receive(wire(Ping(id=41), Ping(id=42)), 0.0) == []
    assert session.take_outgoing() == [Pong(id=41), Pong(id=42)]


@pytest.mark.parametrize("side", [0, 1])
def test_each_side_pings_five_times_a_second(side: int) -> None:
    session = open_pair()[side]
    pings = pass_time(session, 0.0, 0.95)
    assert [ping.id for ping in pings if isinstance(ping, Ping)] == [1, 2, 3, 4]
    assert pytest.approx(0.2) == PING_INTERVAL


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize(
    "noise",
    [
        b"",
        frame(b"\xc1"),
        frame(encode_message(Ping(id=1))[:-1]),
        wire(Hello(role="operator")),
        wire(Ping(id=1))[:-1],
    ],
    ids=["nothing", "malformed", "cut", "not allowed", "unfinished"],
)
def test_a_side_that_sends_nothing_valid_is_dead_after_a_second(side: int, noise: bytes) -> None:
    session = open_pair()[side]
    pass_time(session, 0.0, 0.5)
    session.receive(noise, 0.5)
    pass_time(session, 0.5, SILENCE)
    assert not is_over(session)
    pass_time(session, SILENCE, SILENCE + TICK)
    assert session.ended is not None
    assert session.ended.error == "silent"


def _answer_pings(session: LinkSession, round_trip: float, until: float) -> float:
    """Time passes while the other side answers every ping after `round_trip`; when it said something last."""
    under_way: list[tuple[float, int]] = []
    now = last = 0.0
    while now < until:
        now += TICK
        while under_way and under_way[0][0] <= now:
            session.receive(wire(Pong(id=under_way.pop(0)[1])), now)
            last = now
        session.tick(now)
        under_way += [(now + round_trip, each.id) for each in session.take_outgoing() if isinstance(each, Ping)]
    return last


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize(("round_trip", "patience"), [(0.1, 1.4), (0.3, 2.2), (0.6, 3.4), (0.9, 4.6), (3.0, 5.0)])
def test_on_a_long_path_silence_lasts_four_round_trips_more_and_never_over_five_seconds(
    side: int, round_trip: float, patience: float
) -> None:
    session = open_pair()[side]
    session._last_valid = round_trip  # until the first answer the other side is heard by its own pings
    last = _answer_pings(session, round_trip, 10.0)
    assert session.patience == pytest.approx(patience, abs=4 * TICK)
    pass_time(session, 10.0, last + session.patience - TICK)
    assert not is_over(session)
    pass_time(session, last + session.patience - TICK, last + session.patience + 2 * TICK)
    assert session.ended is not None
    assert session.ended.error == "silent"


def test_a_pong_that_answers_no_ping_says_nothing_of_the_path() -> None:
    session = open_pair()[0]
    for number in range(100):
        session.receive(wire(Pong(id=number)), 0.9)
    assert session.patience == SILENCE


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("life", [Ping(id=1), Pong(id=1)])
def test_a_side_that_is_heard_stays(side: int, life: LinkMessage) -> None:
    session = open_pair()[side]
    for index in range(1, 101):
        if index % 18 == 0:
            session.receive(wire(life), index * TICK)
        session.tick(index * TICK)
    assert session.state is LinkState.OPEN


def test_our_own_stall_is_not_the_other_sides_silence() -> None:
    bridge, _ = open_pair()
    pass_time(bridge, 0.0, 0.5)
    bridge.tick(30.0)
    assert not is_over(bridge)
    pass_time(bridge, 30.0, 30.4)
    assert not is_over(bridge)
    pass_time(bridge, 30.4, 31.2)
    assert is_over(bridge)


def test_malformed_messages_do_not_end_an_open_link() -> None:
    bridge, _ = open_pair()
    events = bridge.receive(frame(b"\xc1") + wire(Stop()) + frame(b"{}"), 0.0)
    assert [type(event) for event in events] == [BadInput, Stop, BadInput]
    assert bridge.state is LinkState.OPEN


@pytest.mark.parametrize("length", [0, MAX_CONTROL_FRAME + 1, 2**32 - 1])
def test_a_frame_out_of_bounds_ends_the_link_after_what_came_before_it(length: int) -> None:
    bridge, _ = open_pair()
    events = bridge.receive(wire(Stop()) + length.to_bytes(4, "big") + wire(Reset()), 0.0)
    assert [type(event) for event in events] == [Stop, BadInput]
    (goodbye,) = bridge.take_outgoing()
    assert isinstance(goodbye, Goodbye)
    assert goodbye.error == "framing"


@pytest.mark.parametrize("side", [0, 1])
def test_a_goodbye_ends_the_session_and_nothing_follows(side: int) -> None:
    session = open_pair()[side]
    assert session.receive(wire(Goodbye(error="closing"), Stop()), 0.0) == []
    assert session.ended == Goodbye(error="closing")
    assert session.receive(wire(Stop()), 0.0) == []
    assert pass_time(session, 0.0, 3.0) == []


def test_ending_says_goodbye_once_and_keeps_the_first_reason() -> None:
    bridge, _ = open_pair()
    bridge.end("closing", "x" * 600)
    bridge.end("silent")
    bridge.lose("gone")
    (goodbye,) = bridge.take_outgoing()
    assert isinstance(goodbye, Goodbye)
    assert (goodbye.error, len(goodbye.detail)) == ("closing", 500)


def test_a_lost_connection_ends_without_a_goodbye() -> None:
    bridge, _ = open_pair()
    bridge.lose("reset by peer")
    assert bridge.take_outgoing() == []
    assert bridge.ended == Goodbye(error="lost", detail="reset by peer")


@given(st.lists(link_messages, max_size=6), st.integers(1, 40))
def test_it_makes_no_difference_how_the_stream_is_cut(messages: list[LinkMessage], size: int) -> None:
    data = wire(*messages)
    whole, cut = open_pair()[0], open_pair()[0]
    expected = whole.receive(data, 0.0)
    events = [event for start in range(0, len(data), size) for event in cut.receive(data[start : start + size], 0.0)]
    assert events == expected
    assert cut.take_outgoing() == whole.take_outgoing()


@given(
    st.lists(
        st.binary(max_size=100) | link_messages.map(wire) | mutated(link_messages.map(wire)), min_size=1, max_size=6
    ),
    st.booleans(),
    st.sampled_from([0, 1]),
)
def test_any_bytes_give_events_bad_input_or_an_end(chunks: list[bytes], handshake: bool, side: int) -> None:
    sessions: tuple[LinkSession, LinkSession] = (BridgeSession(0.0, admit), ClientSession(0.0, "media"))
    session = sessions[side] if handshake else open_pair("media")[side]
    session.take_outgoing()
    for index, chunk in enumerate(chunks):
        session.receive(chunk, index * 0.1)
        session.tick(index * 0.1)
    assert (session.ended is not None) == (session.state is LinkState.ENDED)
    goodbyes = [isinstance(message, Goodbye) for message in session.take_outgoing()]
    assert not any(goodbyes[:-1]), "something followed the goodbye"


def test_a_console_takes_no_status_that_no_peer_could_take() -> None:
    bridge, client = open_pair()
    item = StatusItem(name="a", label="A", kind="text", value="x" * 500, text="y" * 500)
    large, small = Status(event=1, items=[item] * MAX_STATUS_ITEMS), Status(event=1, items=[item] * 30)
    found = client.receive(wire(large, small), 0.0)
    assert found == [BadInput("malformed", f"a status of more than {MAX_STATUS_BYTES} bytes"), small]


def test_a_client_pings_early_for_the_feedback_of_its_command_and_the_next_ping_is_later_by_as_much() -> None:
    _, client = open_pair()
    client.take_outgoing()
    client.sent(Command(event=2, issue=1, nonce=0, values=[0.0, 0.0, 0.0]), 0.0)
    at = client.asks_at
    assert at is not None
    client.tick(at - 0.001)
    assert not client.take_outgoing()
    client.tick(at)
    (ping,) = client.take_outgoing()
    assert isinstance(ping, Ping)
    client.end("closing")
    assert client.asks_at is None
