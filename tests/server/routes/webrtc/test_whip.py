"""WHIP on a whole console: its signalling, and who may publish what for how long."""

import asyncio
import socket
from contextlib import AsyncExitStack
from typing import Any

import httpx
import pytest

from lockstep.protocol.console import Sources
from lockstep.rtc.interfaces import own_addresses
from lockstep.server.publishing.publisher import Publisher
from lockstep.server.publishing.publishers import MOST_CLOSING
from lockstep.server.webrtc.sdp_offer import parse_fragment
from tests.server.media.published.publishing import TestPublisher
from tests.server.offers import offer, section
from tests.server.rig import Rig, TestPeer, eventually, running_console, running_rig

SDP = {"Content-Type": "application/sdp"}
FRAGMENT = {"Content-Type": "application/trickle-ice-sdpfrag"}
CANDIDATE = "a=mid:0\r\na=candidate:1 1 udp 2130706431 127.0.0.1 9 typ host\r\n"
RESTART = "a=ice-ufrag:other\r\na=ice-pwd:0123456789abcdef0123456789\r\n" + CANDIDATE
PICTURES = section("0").replace("a=recvonly", "a=sendonly")


def name(answer: httpx.Response) -> tuple[int, str]:
    problem = answer.json()
    assert answer.headers["content-type"] == "application/problem+json"
    assert problem["status"] == answer.status_code
    return answer.status_code, problem["error"]


async def post(rig: Rig, token: dict[str, str], content: str = "", path: str = "/whip", **more: str) -> httpx.Response:
    return await rig.http.post(path, content=content or offer(PICTURES), headers={**token, **SDP, **more})


async def state(peer: TestPeer, state: str, detail: str, stream: str = "phone") -> None:
    """Until the peer was told so."""

    def says_so(each: Any) -> bool:
        return isinstance(each, Sources) and any(
            (source.stream, source.state, source.detail) == (stream, state, detail) for source in each.sources
        )

    await peer.until(says_so)


def told(peer: TestPeer) -> list[Sources]:
    """All that the peer was told of cameras."""
    return [each for each in peer.heard if isinstance(each, Sources)]


def own() -> str:
    """An address of this machine that is not loopback."""
    return next(each for each in own_addresses() if ":" not in each)


def publishers(rig: Rig) -> list[Publisher]:
    return [*rig.dependencies.publishers]


async def audited(rig: Rig) -> list[tuple[str, str, str]]:
    """Who, what and which camera, of all publications."""
    page = (await rig.http.get("/api/audit", headers=rig.token("supervisor"))).json()
    found = [each for each in page["records"] if each["kind"] == "publication"]
    assert all(each["link"] and each["peer"] for each in found)
    return [(each["who"], each["what"], each["detail"]) for each in found]


async def test_a_published_camera_is_shown_to_everyone_and_they_are_told_by_whom_until_it_ends() -> None:
    async with running_rig(whip="phone#label=Ann's") as rig, rig.peer("observer", "session") as peer:
        await state(peer, "waiting", "")
        token = rig.token("operator")
        async with TestPublisher() as publisher:
            answer = await publisher.post(rig.http, token)
            assert answer.status_code == 201
            assert answer.headers["accept-patch"] == "application/trickle-ice-sdpfrag"
            assert answer.headers["location"].startswith("/whip/")
            assert answer.headers["cache-control"] == "no-store"
            assert "a=recvonly" in answer.text
            await state(peer, "connecting", "")
            await state(peer, "live", "published by operator")
            await eventually(lambda: rig.count("lockstep_media_frames_in_total", stream="phone") > 10)
            assert told(peer)[-1].sources[0].label == "Ann's"
            assert rig.count("lockstep_media_source_live", source="phone") == 1
            await rig.http.get("/metrics", headers=token)
            assert rig.count("lockstep_whip_publishers") == 1
            assert 0 < rig.count("lockstep_whip_path_seconds", source="phone") < 1
            ended = await rig.http.delete(publisher.location, headers=token)
            assert (ended.status_code, ended.content) == (200, b"")
            again = await rig.http.delete(publisher.location, headers=token)
            assert name(again) == (404, "not_found")
        await state(peer, "waiting", "its publisher has left")
        await eventually(lambda: not publishers(rig))
        assert rig.count("lockstep_whip_publishers") == 0
        assert rig.count("lockstep_whip_ended_total", why="deleted") == 1
        assert rig.count("lockstep_internal_errors_total", where="publisher") == 0
        assert await audited(rig) == [("operator", "begun", "phone"), ("operator", "ended: deleted", "phone")]


async def test_where_nothing_may_be_published_there_is_nothing() -> None:
    async with running_rig() as rig:
        for method in ("GET", "POST", "OPTIONS", "PUT"):
            answer = await rig.http.request(method, "/whip", headers={**rig.token("operator"), **SDP}, content="v=0")
            assert name(answer) == (404, "not_found")
        assert all(each["stream"] != "phone" for each in (await rig.session())["streams"])


@pytest.mark.parametrize(
    ("content", "headers", "status", "error"),
    [
        ("v=0", {"Content-Type": "text/plain"}, 415, "wrong_media_type"),
        ("v=0\r\n", {}, 400, "bad_sdp"),
        ("x" * (64 * 1024 + 1), {}, 413, "too_large"),
        (offer(*[section(str(n)) for n in range(17)]), {}, 400, "too_many_sections"),
        (offer(PICTURES, section("1", "application")), {}, 400, "bad_sdp"),
        (offer(PICTURES.replace("VP8", "AV9")), {}, 406, "not_acceptable"),
        (offer(section("0")), {}, 406, "not_acceptable"),  # it would only receive
        (offer(section("0", "audio").replace("recvonly", "sendonly")), {}, 406, "not_acceptable"),
        (offer(PICTURES.replace("VP8/90000", "VP9/90000")), {}, 406, "not_acceptable"),
    ],
)
async def test_what_is_no_publisher_s_offer_is_refused_by_name(
    content: str, headers: dict[str, str], status: int, error: str
) -> None:
    async with running_rig(whip="phone") as rig:
        assert name(await post(rig, rig.token("operator"), content, **headers)) == (status, error)
        assert publishers(rig) == []
        assert rig.count("lockstep_internal_errors_total", where="publisher offer") == 0


async def test_only_operators_and_supervisors_publish_and_strangers_learn_nothing() -> None:
    async with running_rig(whip="phone") as rig:
        assert name(await post(rig, {})) == (401, "unauthorized")
        assert name(await post(rig, {"Authorization": "Bearer nonsense"})) == (401, "unauthorized")
        assert name(await post(rig, rig.token("observer"))) == (403, "not_allowed")
        made = await post(rig, rig.token("supervisor"))
        assert made.status_code == 201
        for token in ({}, rig.token("operator")):
            for answer in (
                await rig.http.delete(made.headers["location"], headers=token),
                await rig.http.patch(made.headers["location"], content=CANDIDATE, headers={**token, **FRAGMENT}),
            ):
                assert answer.status_code == (404 if token else 401)
        assert len(publishers(rig)) == 1


async def test_what_may_be_done_is_said_and_nothing_else_is() -> None:
    async with running_rig(whip="phone") as rig:
        options = await rig.http.options("/whip")
        assert (options.status_code, options.headers["accept-post"]) == (204, "application/sdp")
        options = await rig.http.options("/whip/anything")
        assert options.headers["accept-patch"] == "application/trickle-ice-sdpfrag"
        for path, methods, allowed in (
            ("/whip", ("GET", "PUT", "PATCH", "DELETE"), "OPTIONS, POST"),
            ("/whip/anything", ("GET", "PUT", "POST"), "DELETE, OPTIONS, PATCH"),
        ):
            for method in methods:
                answer = await rig.http.request(method, path, headers=rig.token("operator"))
                assert name(answer) == (405, "method_not_allowed")
                assert answer.headers["allow"] == allowed


async def test_a_camera_has_one_publisher_and_a_link_one_camera() -> None:
    async with running_rig(whip="phone desk") as rig:
        first, second, third = (rig.token("operator") for _ in range(3))
        assert name(await post(rig, first, path="/whip?camera=attic")) == (404, "not_found")
        assert (await post(rig, first, path="/whip?camera=desk")).status_code == 201
        assert name(await post(rig, second, path="/whip?camera=desk")) == (409, "camera_taken")
        assert name(await post(rig, first, path="/whip?camera=phone")) == (409, "already_publishing")
        made = await post(rig, second)  # the first that nobody publishes
        assert made.status_code == 201
        assert {each.camera.spec.name for each in publishers(rig)} == {"phone", "desk"}
        full = await post(rig, third)
        assert name(full) == (409, "camera_taken")
        assert int(full.headers["retry-after"]) > 0
        await rig.http.delete(made.headers["location"], headers=second)
        assert (await post(rig, third)).status_code == 201


async def test_offers_at_once_for_one_camera_make_one_publisher() -> None:
    async with running_rig(whip="phone") as rig:
        answers = await asyncio.gather(*(post(rig, rig.token("operator")) for _ in range(8)))
        assert sorted(each.status_code for each in answers) == [201, *[409] * 7]
        assert len(publishers(rig)) == 1
    async with running_rig(whip="phone desk") as rig:
        same = rig.token("operator")
        answers = await asyncio.gather(*(post(rig, same) for _ in range(4)))
        assert sorted(each.status_code for each in answers) == [201, 409, 409, 409]


async def test_who_publishes_and_leaves_without_end_keeps_no_more_than_a_few_connections_open() -> None:
    async with running_rig(whip="phone") as rig:
        token = rig.token("operator")
        statuses = set()
        for _ in range(40):
            answer = await post(rig, token)
            statuses.add(answer.status_code)
            assert len(publishers(rig)) <= MOST_CLOSING + 1
            if answer.status_code == 201:
                await rig.http.delete(answer.headers["location"], headers=token)
        assert statuses <= {201, 429}
        await eventually(lambda: publishers(rig) == [])
        assert (await post(rig, token)).status_code == 201


async def test_offers_of_one_link_are_limited_together_with_those_of_watching() -> None:
    async with running_rig(whip="phone", max_offer_burst=2, max_offer_rate=0.001) as rig:
        token = rig.token("operator")
        answers = [await post(rig, token, "v=0") for _ in range(3)]
        assert [each.status_code for each in answers] == [400, 400, 429]


async def test_while_the_robot_was_never_reached_there_is_no_camera_to_publish() -> None:
    async with running_console(1, whip="phone") as rig:
        answer = await post(rig, rig.token("operator"))
        assert name(answer) == (409, "robot_unreachable")
        assert "retry-after" in answer.headers


async def test_candidates_are_trickled_and_ice_is_restarted_as_a_publisher_s_reader_expects() -> None:
    async with running_rig(whip="phone") as rig, TestPublisher() as publisher:
        assert (await publisher.post(rig.http, rig.token("operator"))).status_code == 201

        async def patch(content: str, **headers: str) -> httpx.Response:
            sent = {**publisher.headers, **FRAGMENT, **headers}
            return await rig.http.patch(publisher.location, content=content, headers=sent)

        tag = publisher.tag
        assert name(await patch(CANDIDATE)) == (428, "precondition_required")
        assert name(await patch(CANDIDATE, **{"If-Match": '"other"'})) == (412, "precondition_failed")
        assert (await patch(CANDIDATE, **{"If-Match": tag})).status_code == 204
        assert name(await patch("no", **{"If-Match": tag})) == (400, "bad_sdp_fragment")
        await eventually(lambda: rig.count("lockstep_media_frames_in_total", stream="phone") > 2)
        restarted = await patch(RESTART, **{"If-Match": "*"})
        assert restarted.status_code == 200
        assert restarted.headers["etag"] != tag
        assert parse_fragment(restarted.text, "0").candidates
        assert name(await patch(CANDIDATE, **{"If-Match": tag})) == (412, "precondition_failed")
        many = await asyncio.gather(*(patch(CANDIDATE) for _ in range(50)))
        assert 429 in {each.status_code for each in many}


async def test_sound_is_answered_inactive_and_pictures_come_all_the_same() -> None:
    async with running_rig(whip="phone") as rig, TestPublisher("H264", sound=True) as publisher:
        answer = await publisher.post(rig.http, rig.token("operator"))
        audio, video = answer.text.split("m=")[1:]
        assert audio.startswith("audio")
        assert "a=inactive" in audio
        assert "a=recvonly" in video
        assert video.count("a=rtpmap:") == 2  # H.264 and its retransmissions
        await eventually(lambda: rig.count("lockstep_media_frames_in_total", stream="phone") > 5)


@pytest.mark.parametrize("profile", ["42c015", "4d0028", "640c1f", "64001f"])
async def test_pictures_of_all_profiles_that_encoders_make_are_taken(profile: str) -> None:
    coded = "a=rtpmap:96 H264/90000\r\na=fmtp:96 packetization-mode=1;profile-level-id=" + profile
    async with running_rig(whip="phone") as rig:
        answer = await post(rig, rig.token("operator"), offer(PICTURES.replace("a=rtpmap:96 VP8/90000", coded)))
        assert answer.status_code == 201
        assert f"profile-level-id={profile}" in answer.text
        assert "a=recvonly" in answer.text


async def test_packets_of_another_source_are_left_out_and_counted() -> None:
    async with running_rig(whip="phone") as rig, TestPublisher() as publisher:
        sender: Any = publisher.pc.getTransceivers()[0].sender
        assert (await publisher.post(rig.http, rig.token("operator"))).status_code == 201
        await eventually(lambda: rig.count("lockstep_media_frames_in_total", stream="phone") > 2)
        transmit = sender.transport._send_rtp

        async def and_another(data: bytes) -> None:
            await transmit(data)
            if 96 <= data[1] & 0x7F < 127:
                await transmit(data[:8] + b"\x00\x00\x00\x09" + data[12:])

        sender.transport._send_rtp = and_another
        [here] = publishers(rig)
        await eventually(lambda: here.counts()["foreign"] > 5)
        before = rig.count("lockstep_media_frames_in_total", stream="phone")
        await eventually(lambda: rig.count("lockstep_media_frames_in_total", stream="phone") > before + 5)


async def test_a_revoked_link_publishes_nothing_a_moment_later() -> None:
    async with running_rig(whip="phone") as rig, rig.peer("observer", "session") as peer, TestPublisher() as publisher:
        made = await rig.http.post(
            "/api/invitations",
            json={"role": "operator", "name": "Ada", "seconds": 3600},
            headers=rig.token("supervisor"),
        )
        token = {"Authorization": f"Bearer {made.json()['link'].partition('#token=')[2]}"}
        assert (await publisher.post(rig.http, token)).status_code == 201
        await state(peer, "live", "published by Ada")
        await rig.http.delete(f"/api/invitations/{made.json()['id']}", headers=rig.token("supervisor"))
        # It goes on publishing and has its consent, so nothing but the look at the links ends it.
        await state(peer, "waiting", "its publisher's link has ended")
        await eventually(lambda: not publishers(rig))
        assert rig.count("lockstep_whip_ended_total", why="link ended") == 1
        assert name(await post(rig, token)) == (401, "link_revoked")
        assert ("Ada", "ended: link ended", "phone") in await audited(rig)


async def test_a_publisher_that_stalls_is_said_to_and_its_link_alone_may_begin_anew() -> None:
    async with (
        running_rig(whip="phone") as rig,
        rig.peer("observer", "session") as peer,
        TestPublisher() as publisher,
        TestPublisher() as again,
    ):
        token = rig.token("operator")
        await publisher.post(rig.http, token)
        await state(peer, "live", "published by operator")
        publisher.pictures.goes_on.clear()
        await state(peer, "reconnecting", "no data arrives")
        assert rig.count("lockstep_media_source_failures_total", source="phone", reason="silent") == 1
        assert name(await post(rig, rig.token("operator"))) == (409, "camera_taken")
        seen = len(told(peer))
        assert (await again.post(rig.http, token)).status_code == 201
        await eventually(lambda: "live" in [each.sources[0].state for each in told(peer)[seen:]])
        await eventually(lambda: len(publishers(rig)) == 1)
        assert rig.count("lockstep_whip_ended_total", why="replaced") == 1


async def test_a_publisher_that_goes_silent_for_long_or_never_connects_is_ended() -> None:
    async with running_rig(whip="phone", peer_connect_timeout=0.5) as rig:
        assert (await post(rig, rig.token("operator"))).status_code == 201
        await eventually(lambda: rig.count("lockstep_whip_ended_total", why="never connected") == 1)
    async with running_rig(whip="phone", peer_silence=1.0) as rig, TestPublisher() as publisher:
        await publisher.post(rig.http, rig.token("operator"))
        await eventually(lambda: rig.count("lockstep_media_frames_in_total", stream="phone") > 2)
        publisher.pictures.goes_on.clear()
        await eventually(lambda: rig.count("lockstep_whip_ended_total", why="silent") == 1)


async def test_what_is_no_picture_is_counted_and_disturbs_neither_who_drives_nor_another_publisher() -> None:
    async with AsyncExitStack() as stack:
        rig = await stack.enter_async_context(running_rig(whip="phone desk"))
        driver = await stack.enter_async_context(rig.peer("operator"))
        bad = await stack.enter_async_context(TestPublisher())
        good = await stack.enter_async_context(TestPublisher())
        sender: Any = bad.pc.getTransceivers()[0].sender
        transmit = sender.transport._send_rtp

        async def spoil(data: bytes) -> None:
            if 96 <= data[1] & 0x7F < 127:  # a packet of pictures, which has header extensions
                head = 16 + 4 * int.from_bytes(data[14:16], "big")
                data = data[:head] + b"\xff" * (len(data) - head)
            await transmit(data)

        assert (await bad.post(rig.http, rig.token("operator"))).status_code == 201
        sender.transport._send_rtp = spoil
        assert (await good.post(rig.http, rig.token("operator"))).status_code == 201
        await eventually(lambda: rig.count("lockstep_media_frames_in_total", stream="desk") > 20)
        await rig.http.get("/metrics", headers=rig.token("operator"))
        assert rig.count("lockstep_whip_unused_total", reason="malformed") > 0
        assert rig.count("lockstep_media_frames_in_total", stream="phone") == 0
        assert not driver.closed.is_set()
        assert rig.count("lockstep_internal_errors_total", where="publisher") == 0


async def test_a_decoder_that_dies_ends_its_publisher_alone() -> None:
    async with running_rig(whip="phone") as rig, rig.peer("observer", "session") as peer, TestPublisher() as publisher:
        await publisher.post(rig.http, rig.token("operator"))
        await state(peer, "live", "published by operator")
        [here] = publishers(rig)
        process: Any = here._decoder
        process._input.close()  # it ends with its input
        await state(peer, "waiting", "the connection to its publisher is lost")
        assert rig.count("lockstep_whip_ended_total", why="decoder died") == 1
        assert not peer.closed.is_set()


async def test_a_console_that_ends_takes_its_publishers_along() -> None:
    async with TestPublisher() as publisher:
        async with running_rig(whip="phone") as rig:
            await publisher.post(rig.http, rig.token("operator"))
            await eventually(lambda: rig.count("lockstep_media_frames_in_total", stream="phone") > 2)
        assert rig.count("lockstep_whip_ended_total", why="shutdown") == 1


async def test_an_offer_for_which_servers_are_asked_too_long_leaves_nothing_behind(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        stun = f"stun:127.0.0.1:{silent.getsockname()[1]}"
        async with running_rig(whip="phone", relay_console=True, stun=stun) as rig:
            monkeypatch.setattr("lockstep.server.routes.webrtc.negotiation.NEGOTIATION_TIMEOUT", 0.2)
            assert name(await post(rig, rig.token("operator"))) == (400, "bad_sdp")
            endpoint: Any = rig.dependencies.context.endpoint
            assert endpoint._endpoint._connections == {}
            assert publishers(rig) == []


async def test_the_answer_names_the_outer_address_of_a_console_behind_a_nat_after_its_own() -> None:
    async with running_rig(whip="phone", ice_hosts=("127.0.0.3", own()), advertise="203.0.113.7") as rig:
        answer = await post(rig, rig.token("operator"))
        lines = [line.split() for line in answer.text.splitlines() if line.startswith("a=candidate")]
        assert {line[4] for line in lines} == {"127.0.0.3", own(), "203.0.113.7"}
        assert len({line[5] for line in lines}) == 1, "one port, which a NAT forwards"
        [outer] = [line for line in lines if line[4] == "203.0.113.7"]
        assert outer[outer.index("raddr") + 1] == own(), "no NAT leads to loopback"


async def test_datagrams_of_strangers_are_dropped_and_counted() -> None:
    async with running_rig(whip="phone") as rig, TestPublisher() as publisher:
        answer = await publisher.post(rig.http, rig.token("operator"))
        line = next(line.split() for line in answer.text.splitlines() if line.startswith("a=candidate"))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            for datagram in (b"", b"\x80" * 100, b"\x16\xfe\xff" + bytes(50), b"\x00\x01" + bytes(18), bytes(2000)):
                stranger.sendto(datagram, (line[4], int(line[5])))

        async def counted() -> bool:
            await rig.http.get("/metrics", headers=rig.token("operator"))
            return rig.count("lockstep_bad_input_total", where="transport", reason="unknown_source") >= 2

        async with asyncio.timeout(20):
            while not await counted():  # noqa: ASYNC110
                await asyncio.sleep(0.05)
        assert rig.count("lockstep_internal_errors_total", where="loop") == 0
        await eventually(lambda: rig.count("lockstep_media_frames_in_total", stream="phone") > 2)
