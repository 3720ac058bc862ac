from lockstep.rtc.rtp.router import Route, Router
from tests.rtc.rtp.packets import packet

ROUTES = (
    Route("camera", frozenset((96, 97)), frozenset((10, 11)), 1),
    Route("other", frozenset((96, 97)), mid_extension=1),
    Route("microphone", frozenset((111,)), mid_extension=1),
)


def test_the_mid_counts_most_then_the_ssrc_then_a_payload_type_of_one_section() -> None:
    router = Router(ROUTES)
    assert router.route(packet(ssrc=10)) == "camera"
    assert router.route(packet(ssrc=20, extensions={1: b"other"})) == "other"
    assert router.route(packet(ssrc=20)) == "other"
    assert router.route(packet(ssrc=30, payload_type=111)) == "microphone"
    assert router.route(packet(ssrc=40)) is None
    assert router.route(packet(ssrc=20, extensions={1: b"camera"})) == "camera"
    assert router.route(packet(ssrc=20)) == "camera"
    assert sorted(router.ssrcs_of("camera")) == [10, 11, 20]
    assert router.counts == {"unknown": 1}


def test_a_payload_type_of_another_section_and_an_unknown_mid_are_not_believed() -> None:
    router = Router(ROUTES)
    assert router.route(packet(ssrc=10, payload_type=111)) is None
    assert router.route(packet(ssrc=50, extensions={1: b"\xff"})) is None
    assert router.route(packet(ssrc=50, extensions={2: b"camera"})) is None
    assert router.counts == {"unknown": 3}


def test_the_ssrcs_that_are_remembered_are_bounded() -> None:
    router = Router(ROUTES)
    for ssrc in range(100, 162):
        assert router.route(packet(ssrc=ssrc, extensions={1: b"camera"})) == "camera"
    assert router.route(packet(ssrc=200, extensions={1: b"camera"})) is None
    assert router.counts == {"sources": 1}
    assert router.route(packet(ssrc=100)) == "camera"
