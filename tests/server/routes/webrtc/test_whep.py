"""WHEP over real HTTP."""

import asyncio
import socket
from typing import Any

import httpx
import pytest
from aiortc import RTCConfiguration, RTCPeerConnection
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lockstep.bench.harness.free_port import free_port
from lockstep.protocol.console import Role
from lockstep.protocol.messages import Ping, Pong
from lockstep.server.webrtc.sdp_offer import parse_fragment
from tests.server.offers import offer, section
from tests.server.rig import PATIENCE, Rig, TestPeer, running_console, running_rig

SDP = {"Content-Type": "application/sdp"}
FRAGMENT = {"Content-Type": "application/trickle-ice-sdpfrag"}
RESTART = "a=ice-ufrag:other\r\na=ice-pwd:0123456789abcdef0123456789\r\n"
CANDIDATE = "a=candidate:1 1 udp 2130706431 127.0.0.1 5000 typ host\r\n"


async def _post(rig: Rig, text: str | bytes, path: str = "/whep", **headers: str) -> httpx.Response:
    return await rig.http.post(path, content=text, headers={**rig.token("observer"), **SDP, **headers})


async def _real_offer(*, video: bool = False) -> str:
    pc = RTCPeerConnection(RTCConfiguration(iceServers=[]))
    try:
        pc.createDataChannel("control")
        if video:
            pc.addTransceiver("video", "recvonly")
        await pc.setLocalDescription(await pc.createOffer())
        return pc.localDescription.sdp
    finally:
        await pc.close()


async def _until_no_peers(rig: Rig) -> None:
    async with asyncio.timeout(PATIENCE):
        await rig.dependencies.console.peers.all_gone()
    assert len(rig.dependencies.console.peers) == 0


async def test_an_offer_is_answered_and_the_resource_can_be_deleted() -> None:
    async with running_rig() as rig:
        answer = await _post(rig, await _real_offer(video=True))
        assert answer.status_code == 201
        assert answer.headers["content-type"].startswith("application/sdp")
        assert answer.headers["accept-patch"] == "application/trickle-ice-sdpfrag"
        assert answer.headers["cache-control"] == "no-store"
        assert "m=video" in answer.text
        location = answer.headers["location"]
        assert location.startswith("/whep/")
        gone = await rig.http.delete(location, headers=rig.token("observer"))
        assert gone.status_code == 404, "another token's resource is as good as none"


async def test_the_answer_offers_the_addresses_that_were_set_and_no_other() -> None:
    async with running_rig(ice_hosts=("127.0.0.2",)) as rig:
        answer = await rig.http.post("/whep", content=await _real_offer(), headers={**rig.token("observer"), **SDP})
        hosts = {line.split()[4] for line in answer.text.splitlines() if line.startswith("a=candidate:")}
        assert hosts == {"127.0.0.2"}


async def test_who_made_a_peer_can_trickle_to_it_and_end_it() -> None:
    async with running_rig() as rig:
        headers = rig.token("observer")
        answer = await rig.http.post("/whep", content=await _real_offer(), headers={**headers, **SDP})
        location, tag = answer.headers["location"], {"If-Match": answer.headers["etag"]}
        for content, more, status, name in [
            (CANDIDATE, {**FRAGMENT, **tag}, 204, ""),
            (CANDIDATE.replace("127.0.0.1", "0a1b.local"), {**FRAGMENT, **tag}, 204, ""),
            (CANDIDATE.replace("127.0.0.1", "host.example.org"), {**FRAGMENT, **tag}, 204, ""),
            (CANDIDATE, {**FRAGMENT, "If-Match": f'"other", {tag["If-Match"]}'}, 204, ""),
            (CANDIDATE, FRAGMENT, 428, "precondition_required"),
            (CANDIDATE, {**FRAGMENT, "If-Match": '"other"'}, 412, "precondition_failed"),
            (RESTART, {**FRAGMENT, **tag}, 400, "bad_sdp_fragment"),
            ("a=ice-ufrag:other\r\n", {**FRAGMENT, "If-Match": "*"}, 400, "bad_sdp_fragment"),
            (RESTART, {**FRAGMENT, "If-Match": "*"}, 409, "not_connected"),
            ("a=candidate:what\r\n", {**FRAGMENT, **tag}, 400, "bad_sdp_fragment"),
        ]:
            patch = await rig.http.patch(location, content=content, headers={**headers, **more})
            assert (patch.status_code, patch.json()["error"] if name else "") == (status, name), content
        assert (await rig.http.delete(location, headers=headers)).status_code == 200
        await _until_no_peers(rig)
        assert (await rig.http.delete(location, headers=headers)).status_code == 404
        assert rig.count("lockstep_peers_ended_total", why="deleted") == 1


@pytest.mark.parametrize(
    ("content", "content_type", "status", "name"),
    [
        (CANDIDATE.replace("5000", "x"), FRAGMENT, 400, "bad_sdp_fragment"),
        ("rubbish", FRAGMENT, 400, "bad_sdp_fragment"),
        (CANDIDATE, SDP, 415, "wrong_media_type"),
    ],
)
async def test_what_is_no_fragment_is_refused_by_name(
    content: str, content_type: dict[str, str], status: int, name: str
) -> None:
    async with running_rig() as rig:
        headers = rig.token("observer")
        answer = await rig.http.post("/whep", content=await _real_offer(), headers={**headers, **SDP})
        headers |= {**content_type, "If-Match": answer.headers["etag"]}
        patch = await rig.http.patch(answer.headers["location"], content=content, headers=headers)
        assert (patch.status_code, patch.json()["error"]) == (status, name)


async def test_no_more_requests_and_candidates_than_a_session_needs_are_taken() -> None:
    async with running_rig() as rig:
        headers = rig.token("observer")
        answer = await rig.http.post("/whep", content=await _real_offer(), headers={**headers, **SDP})
        headers |= {**FRAGMENT, "If-Match": answer.headers["etag"]}
        many = "".join(CANDIDATE.replace("5000", str(5000 + each)) for each in range(60))
        url = answer.headers["location"]
        first = await rig.http.patch(url, content=many, headers=headers)
        assert first.status_code == 204
        second = await rig.http.patch(url, content=many, headers=headers)
        said = second.json()
        assert (said["error"], said["detail"]) == ("bad_sdp_fragment", "too many candidates for one session")
        rest = await asyncio.gather(*(rig.http.patch(url, content="", headers=headers) for _ in range(50)))
        refused = next(each for each in rest if each.status_code != 204)
        assert (refused.status_code, refused.json()["error"]) == (429, "too_many_requests")
        assert refused.headers["retry-after"] == "2"


async def test_an_ice_restart_is_answered_with_new_credentials_and_a_new_tag() -> None:
    async with running_rig() as rig, rig.peer("observer") as peer:
        headers = {**peer.headers, **FRAGMENT, "If-Match": "*"}
        answer = await rig.http.patch(peer.location, content=RESTART, headers=headers)
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith("application/trickle-ice-sdpfrag")
        fragment = parse_fragment(answer.text, "0")
        assert fragment.ufrag not in peer.pc.remoteDescription.sdp
        assert len(fragment.password) >= 22
        assert fragment.candidates
        old = await rig.http.patch(peer.location, content=CANDIDATE, headers={**headers, "If-Match": peer.tag})
        assert old.json()["error"] == "precondition_failed"
        tag = {"If-Match": answer.headers["etag"]}
        more = await rig.http.patch(peer.location, content="a=ice-ufrag:other\r\n" + CANDIDATE, headers=headers | tag)
        assert more.status_code == 204
        again = await rig.http.patch(peer.location, content=RESTART.replace("other", "third"), headers=headers)
        assert again.status_code == 200, "a restart under way is given up for a newer one"
        peer.send("control", Ping(id=7))
        await peer.until(lambda each: each == Pong(id=7))


@pytest.mark.parametrize(
    ("content", "headers", "status", "name"),
    [
        ("v=0", {"Content-Type": "text/plain"}, 415, "wrong_media_type"),
        ("v=0", {"Content-Type": ""}, 415, "wrong_media_type"),
        (b"\xff\xfe", {}, 415, "wrong_media_type"),
        ("", {}, 400, "bad_sdp"),
        ("v=0\r\n", {}, 400, "bad_sdp"),
        ("x" * (64 * 1024 + 1), {}, 413, "too_large"),
        (offer(section("0").replace("VP8", "AV9")), {}, 400, "bad_sdp"),
        (offer(section("0").replace("a=rtcp-mux\r\n", "")), {}, 400, "bad_sdp"),
        (offer(section("0").replace("UDP/TLS/RTP/SAVPF", "what")), {}, 400, "bad_sdp"),
    ],
)
async def test_what_is_no_offer_is_refused_by_name(
    content: str | bytes, headers: dict[str, str], status: int, name: str
) -> None:
    async with running_rig() as rig:
        answer = await _post(rig, content, **headers)
        assert (answer.status_code, answer.json()["error"]) == (status, name)
        assert rig.count("lockstep_bad_input_total", where="http", reason=name) == 1
        assert len(rig.dependencies.console.peers) == 0


async def test_a_content_type_may_have_parameters_and_any_case() -> None:
    async with running_rig() as rig:
        answer = await _post(rig, await _real_offer(), **{"Content-Type": "Application/SDP; charset=utf-8"})
        assert answer.status_code == 201


async def test_an_unknown_stamp_is_refused() -> None:
    async with running_rig() as rig:
        answer = await _post(rig, await _real_offer(), "/whep?stamp=postcard")
        assert (answer.status_code, answer.json()["error"]) == (422, "bad_parameter")


async def test_while_the_robot_was_never_reached_there_is_nothing_to_offer() -> None:
    async with running_console(1) as rig:
        answer = await _post(rig, await _real_offer())
        assert (answer.status_code, answer.json()["error"]) == (409, "robot_unreachable")
        assert answer.headers["retry-after"] == "1"


async def test_when_all_places_are_taken_the_next_is_refused_and_a_place_becomes_free_again() -> None:
    async with running_rig(max_peers=1) as rig:
        async with rig.peer("observer"):
            answer = await _post(rig, await _real_offer())
            assert (answer.status_code, answer.json()["error"]) == (503, "too_many_peers")
        await _until_no_peers(rig)
        async with rig.peer("observer"):
            pass


async def test_a_peer_that_never_connects_is_ended() -> None:
    async with running_rig(peer_connect_timeout=0.1) as rig:
        assert (await _post(rig, await _real_offer())).status_code == 201
        await _until_no_peers(rig)
        assert rig.count("lockstep_peers_ended_total", why="never connected") == 1


async def test_a_peer_with_channels_that_says_nothing_is_ended() -> None:
    async with running_rig(peer_silence=1.0) as rig, rig.peer("observer") as peer:
        async with asyncio.timeout(PATIENCE):
            await peer.closed.wait()
        await _until_no_peers(rig)
        assert rig.count("lockstep_peers_ended_total", why="silent") == 1


async def test_a_player_without_channels_is_not_ended_for_its_silence() -> None:
    async with running_rig(peer_silence=0.1) as rig:
        player = TestPeer()
        player.pc.addTransceiver("video", "recvonly")
        connected = asyncio.Event()
        player.pc.on("connectionstatechange", connected.set)
        try:
            await player.join(rig, rig.token("observer"), ())
            async with asyncio.timeout(PATIENCE):
                while player.pc.connectionState != "connected":
                    connected.clear()
                    await connected.wait()
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(0.5):
                    await rig.dependencies.console.peers.all_gone()
        finally:
            await player.close()


def _mutations(good: str) -> st.SearchStrategy[str]:
    """`good` with some stretches replaced."""

    def mutate(changes: list[tuple[int, int, str]]) -> str:
        text = good
        for place, length, instead in changes:
            text = text[:place] + instead + text[place + length :]
        return text

    change = st.tuples(st.integers(0, len(good)), st.integers(0, 40), st.text(max_size=8))
    return st.lists(change, max_size=3).map(mutate)


def test_no_offer_gets_anything_but_an_answer_or_a_named_error() -> None:
    """One console for all examples; what is left of them must not pile up."""
    with asyncio.Runner() as runner:
        good = runner.run(_real_offer(video=True))
        context = running_rig(peer_connect_timeout=0.05, max_peers=1000)
        rig = runner.run(context.__aenter__())
        tasks = len(asyncio.all_tasks(runner.get_loop()))

        @settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
        @given(_mutations(good) | st.lists(st.sampled_from(good.splitlines()), max_size=60).map("\r\n".join))
        def no_surprise(text: str) -> None:
            answer = runner.run(_post(rig, text.encode("utf-8", "surrogatepass")))
            assert answer.status_code in (201, 400, 413, 415), answer.text
            if answer.status_code != 201:
                assert answer.json()["error"] in ("bad_sdp", "wrong_media_type")

        no_surprise()
        runner.run(_until_no_peers(rig))
        assert rig.count("lockstep_internal_errors_total", where="peer") == 0
        runner.run(asyncio.sleep(0.2))
        assert len(asyncio.all_tasks(runner.get_loop())) <= tasks + 3
        runner.run(context.__aexit__(None, None, None))


@pytest.mark.parametrize(("role", "waits"), [("observer", True), ("operator", False), ("supervisor", False)])
async def test_only_what_an_observer_sends_waits_for_its_turn(
    role: Role, waits: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A supervisor may drive, and says STOP on a channel as an operator does."""
    async with running_rig() as rig:
        connected: list[dict[str, Any]] = []
        connect = rig.dependencies.context.endpoint.connect

        async def noted(*arguments: Any, **named: Any) -> Any:
            connected.append(named)
            return await connect(*arguments, **named)

        monkeypatch.setattr(rig.dependencies.context.endpoint, "connect", noted)
        headers = {**rig.token(role), **SDP}
        assert (await rig.http.post("/whep", content=await _real_offer(), headers=headers)).status_code == 201
    (named,) = connected
    assert named["turns"].may_go_at_once() is not waits
    # An acknowledgement to whoever drives waits for the next feedback and no longer.
    assert (named["settings"].sctp.acknowledgement_delay > 0.05) is waits


async def test_what_may_be_posted_is_said_and_there_is_nothing_to_get() -> None:
    async with running_rig() as rig:
        asked = await rig.http.options("/whep")
        assert (asked.status_code, asked.headers["accept-post"]) == (204, "application/sdp")
        for method in ("GET", "HEAD", "PUT", "PATCH", "DELETE"):
            got = await rig.http.request(method, "/whep")
            assert (got.status_code, got.headers["allow"]) == (405, "OPTIONS, POST"), method
            assert method == "HEAD" or got.json()["error"] == "method_not_allowed", method


async def test_a_section_with_an_unknown_codec_is_rejected_and_the_peer_connects_all_the_same() -> None:
    async with running_rig() as rig:
        answer = await _post(rig, (await _real_offer(video=True)).replace("VP8", "VP7").replace("H264", "H263"))
        assert answer.status_code == 201
        assert "m=video 0 " in answer.text
        assert "m=application 0 " not in answer.text


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("a=setup:actpass\r\n", "section 0: needs a=setup"),
        ("a=rtcp-mux\r\n", "section 0: needs a=rtcp-mux"),
    ],
)
async def test_a_refusal_names_the_section_and_what_it_lacks(line: str, words: str) -> None:
    async with running_rig() as rig:
        answer = await _post(rig, offer(section("0").replace(line, "")))
        assert (answer.status_code, answer.json()["error"]) == (400, "bad_sdp")
        assert words in answer.json()["detail"]


async def test_whoever_wants_all_streams_is_told_when_an_offer_has_too_few_sections_for_them() -> None:
    async with running_rig() as rig:
        kinds = [stream.kind for stream in rig.dependencies.media.offers]
        enough = offer(*(section(f"{number}", kind) for number, kind in enumerate(kinds)))
        missing = offer(
            *(section(f"{number}", kind) for number, kind in enumerate(kinds[:-1])), section("9", "application")
        )
        answer = await _post(rig, missing, "/whep?sections=all")
        assert (answer.status_code, answer.json()["error"]) == (409, "too_few_sections")
        assert len(rig.dependencies.console.peers) == 0
        assert (await _post(rig, missing)).status_code == 201
        assert (await _post(rig, enough, "/whep?sections=all")).status_code == 201
        assert (await _post(rig, enough, "/whep?sections=some")).status_code == 422


async def test_an_offer_that_cannot_be_answered_in_time_leaves_no_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    """The STUN server never answers, so that the console waits for an address of its own."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        stun = f"stun:127.0.0.1:{silent.getsockname()[1]}"
        async with running_rig(stun=(stun,), relay_console=True) as rig:
            monkeypatch.setattr("lockstep.server.routes.webrtc.negotiation.NEGOTIATION_TIMEOUT", 0.1)
            headers = {**rig.token("operator"), "Content-Type": "application/sdp"}
            answer = await rig.http.post("/whep", content=offer(section("0")), headers=headers)
            assert (answer.status_code, answer.json()["error"]) == (400, "bad_sdp")
            assert len(rig.dependencies.console.peers) == 0
            monkeypatch.setattr("lockstep.server.routes.webrtc.negotiation.NEGOTIATION_TIMEOUT", 10.0)
            answer = await rig.http.post("/whep", content=offer(section("0")), headers=headers)
            assert answer.status_code == 201, "what was given up holds nobody up"


async def test_all_peers_come_to_the_one_port_that_was_set_by_udp_and_by_tcp() -> None:
    port = free_port()
    async with running_rig(ice_hosts=("127.0.0.1",), media_port=port, media_tcp=True) as rig:
        for role in ("observer", "operator"):
            headers = {**rig.token(role), **SDP}
            answer = await rig.http.post("/whep", content=await _real_offer(), headers=headers)
            found = [line.split() for line in answer.text.splitlines() if line.startswith("a=candidate:")]
            assert {(each[2], each[4], each[5]) for each in found} == {
                ("udp", "127.0.0.1", str(port)),
                ("tcp", "127.0.0.1", str(port)),
            }
        async with rig.peer("observer") as peer:
            peer.send("control", Ping(id=7))
            await peer.until(lambda each: each == Pong(id=7))
