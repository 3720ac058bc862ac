"""What several links ask of one encoder, merged."""

from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.messages import EncodeRequest, StreamRequest
from lockstep.robot_bridge.encoding.encoding_requests import (
    FIRST_BITRATE,
    LEAST_BITRATE,
    EncodingRequests,
    FrameRateGate,
    KeyframeSpacing,
)


def asks(**fields: float) -> EncodeRequest:
    return EncodeRequest(streams=[StreamRequest(stream="front", **fields)])  # type: ignore[arg-type]


def requests_of(*links: str) -> EncodingRequests[str]:
    requests: EncodingRequests[str] = EncodingRequests(["front", "overview"])
    for link in links:
        requests.joined(link)
    return requests


def test_a_bridge_that_nobody_has_asked_begins_with_little() -> None:
    assert requests_of("a").goal("front") == (FIRST_BITRATE, 0.0, 1.0)


def test_the_least_that_any_link_asks_for_counts() -> None:
    requests = requests_of("a", "b", "c")
    requests.asked("a", asks(bitrate=800_000, frame_rate=30, scale=0.5))
    requests.asked("b", asks(bitrate=500_000, frame_rate=0, scale=1))
    assert requests.goal("front") == (500_000, 30, 0.5)
    requests.left("b")
    assert requests.goal("front") == (800_000, 30, 0.5)


def test_the_newest_request_of_a_link_replaces_the_one_before() -> None:
    requests = requests_of("a")
    requests.asked("a", asks(bitrate=800_000, scale=0.5))
    requests.asked("a", EncodeRequest(streams=[]))
    assert requests.goal("front") == (FIRST_BITRATE, 0.0, 1.0)


def test_no_request_makes_an_encoder_aim_at_nothing() -> None:
    requests = requests_of("a")
    requests.asked("a", asks(bitrate=1, frame_rate=0.001, scale=0.001))
    goal = requests.goal("front")
    assert goal.bitrate == LEAST_BITRATE
    assert goal.frame_rate > 0
    assert goal.size(640, 480) == (64, 48)
    assert goal.size(20, 20) == (16, 16)


def test_a_request_of_a_link_that_is_gone_counts_for_nothing() -> None:
    requests = requests_of("a")
    requests.left("a")
    requests.asked("a", asks(bitrate=800_000, keyframes=3))
    assert requests.goal("front").bitrate == FIRST_BITRATE


def test_streams_that_the_robot_does_not_have_leave_nothing_behind() -> None:
    requests = requests_of("a")
    for number in range(100):
        name = f"camera {number}"
        requests.asked("a", EncodeRequest(streams=[StreamRequest(stream=name, bitrate=50_000, keyframes=1)]))
        assert requests.goal(name).bitrate == FIRST_BITRATE
    assert not requests._wanted
    assert requests._served == {"a": {}}


def test_a_keyframe_is_made_for_a_new_link_and_for_each_higher_count() -> None:
    requests = requests_of("a")
    assert requests.wants_keyframe("front")
    requests.keyframe_made("front")
    assert not requests.wants_keyframe("front")
    requests.asked("a", asks(keyframes=1))
    assert requests.wants_keyframe("front")
    requests.keyframe_made("front")
    requests.asked("a", asks(keyframes=1))  # a repeat
    assert not requests.wants_keyframe("front")
    requests.joined("b")
    assert requests.wants_keyframe("front")


def test_a_link_that_dropped_pictures_gets_a_keyframe() -> None:
    requests = requests_of("a")
    requests.keyframe_made("front")
    requests.lost("front")
    assert requests.wants_keyframe("front")
    assert requests.wants_keyframe("overview")  # which has made none yet


def test_keyframes_keep_their_spacing_also_when_the_clock_jumps_back() -> None:
    spacing = KeyframeSpacing()
    assert spacing.allows(5.0)
    spacing.made(5.0)
    assert not spacing.allows(5.1)
    assert spacing.allows(5.3)
    assert spacing.allows(1.0)


@given(
    st.floats(0.5, 60),
    st.floats(0.5, 120),
    st.lists(st.floats(0.0, 0.2), min_size=50, max_size=200),
)
def test_no_more_pictures_pass_than_the_rate_allows(wanted: float, camera: float, jitter: list[float]) -> None:
    gate, times = FrameRateGate(), [n / camera + late / camera for n, late in enumerate(jitter)]
    taken = [time for time in times if gate.takes(time, wanted)]
    span = times[-1] - times[0]
    assert len(taken) <= span * wanted + 2
    assert len(taken) >= min(len(times), span * wanted) * 0.5 - 2


def test_pictures_that_come_evenly_are_left_out_evenly() -> None:
    gate = FrameRateGate()
    taken = [n for n in range(31) if gate.takes(n / 30, 10)]
    assert taken == list(range(0, 31, 3))
    assert all(gate.takes(n / 30, 0) for n in range(31))


@given(
    st.lists(
        st.one_of(
            st.tuples(st.just("joined"), st.integers(0, 3)),
            st.tuples(st.just("left"), st.integers(0, 3)),
            st.tuples(st.just("asked"), st.integers(0, 3), st.integers(0, 5)),
            st.tuples(st.just("made")),
            st.tuples(st.just("lost")),
        ),
        max_size=60,
    )
)
def test_whoever_needs_a_keyframe_is_not_forgotten(steps: list[tuple[object, ...]]) -> None:
    requests: EncodingRequests[object] = EncodingRequests(["front", "overview"])
    owed, counts = True, {}  # counts: of the links that are there
    for step in steps:
        match step:
            case ("joined", link):
                requests.joined(link)
                owed, counts[link] = True, 0
            case ("left", link):
                requests.left(link)
                counts.pop(link, None)
            case ("asked", link, int(count)):
                requests.asked(link, asks(keyframes=count))
                if link in counts and count > counts[link]:
                    owed, counts[link] = True, count
            case ("made",):
                requests.keyframe_made("front")
                owed = False
            case ("lost",):
                requests.lost("front")
                owed = True
        assert requests.wants_keyframe("front") == owed
