"""Host names, and requests of an address; over real HTTP where the console's own answer matters."""

import asyncio
import time
from collections import Counter
from collections.abc import Callable

import pytest
from starlette.types import Message, Receive, Scope, Send

from lockstep.server.errors import HostRefused
from lockstep.server.http.transport.client_address import NO_ADDRESS
from lockstep.server.http.trusted_host import STOP_BURST, STOP_RATE, HostNames, TrustedHost, client_address
from lockstep.server.util.rate_limits import RateLimits
from tests.server.rig import running_rig


@pytest.mark.parametrize(
    "host",
    [
        "127.0.0.1:8000",
        "[::1]:8000",
        "192.168.1.7",
        "localhost",
        "a.localhost:1",
        "Robot.Example",
        "here",
        "here.local",
    ],
)
def test_addresses_and_own_names_pass(host: str) -> None:
    HostNames(("robot.example",), machine="here").check(host)


@pytest.mark.parametrize("host", [None, "", "evil.example", "127.0.0.1.evil.example", "[::1", "localhost.evil", ":80"])
def test_other_names_are_refused(host: str | None) -> None:
    with pytest.raises(HostRefused):
        HostNames(("robot.example",), machine="here").check(host)


def test_with_a_star_every_name_passes() -> None:
    HostNames(("*",)).check("evil.example")


def test_ipv6_clients_are_counted_by_their_network() -> None:
    assert client_address({"client": ("192.0.2.1", 5)}) == "192.0.2.1"
    assert client_address({"client": ("2001:db8::1", 5)}) == client_address({"client": ("2001:db8::2", 5)})
    assert client_address({"client": ("2001:db8:0:1::1", 5)}) != client_address({"client": ("2001:db8::2", 5)})
    assert client_address({"client": ("unix", 0)}) == client_address({"client": ("x" * 16_000, 0)}) == NO_ADDRESS
    assert client_address({"client": None}) == ""


async def test_a_name_that_is_not_ours_gets_no_page_and_no_api() -> None:
    async with running_rig(allowed_hosts="robot.example") as rig:
        for path in ("/", "/api/session", "/healthz"):
            answer = await rig.http.get(path, headers={"Host": "evil.example", **rig.token("observer")})
            assert (answer.status_code, answer.json()["error"]) == (421, "host_refused"), path
            assert answer.headers["x-content-type-options"] == "nosniff"
        assert rig.count("lockstep_bad_input_total", where="http", reason="host_refused") == 3
        assert (await rig.http.get("/healthz", headers={"Host": "robot.example:8000"})).status_code == 200


async def test_an_address_that_asks_too_often_is_refused_but_may_still_stop_the_robot() -> None:
    async with running_rig(max_request_burst=3, max_request_rate=0.001) as rig:
        answers = [await rig.http.get("/api/session", headers=rig.token("observer")) for _ in range(4)]
        assert [answer.status_code for answer in answers] == [200, 200, 200, 429]
        assert answers[3].json()["error"] == "too_many_requests"
        assert answers[3].headers["retry-after"]
        assert (await rig.http.post("/api/stop")).status_code == 429
        for _ in range(5):
            assert (await rig.http.post("/api/stop", headers=rig.token("observer"))).status_code == 200
        for method in ("GET", "HEAD", "OPTIONS", "DELETE"):
            no_stop = await rig.http.request(method, "/api/stop", headers=rig.token("observer"))
            assert no_stop.status_code == 429, method
        health = [(await rig.http.get("/healthz")).status_code for _ in range(4)]
        assert health == [200, 200, 200, 429], "counted apart"


def _stop_door(
    answered: list[str], turned_away: list[str], silenced: tuple[str, ...] = (), now: Callable[[], float] = lambda: 0.0
) -> TrustedHost:
    """One that takes two requests of an address. The link of a request is its header x-link."""

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        answered.append(scope["link"])

    return TrustedHost(
        app,
        HostNames(()),
        RateLimits(0.001, 2),
        lambda scope, name: turned_away.append(scope["link"]),
        now,
        link_of=lambda scope: str(scope["link"]),
        is_silenced=lambda scope, link: link in silenced,
    )


async def _ask(door: TrustedHost, link: str, path: str = "/api/stop", method: str = "POST", kind: str = "http") -> None:
    async def receive() -> Message:
        raise AssertionError("nothing to receive")

    async def send(message: Message) -> None:
        pass

    scope = {"type": kind, "path": path, "headers": [(b"host", b"localhost")], "link": link}
    await door(scope | ({"method": method} if kind == "http" else {}), receive, send)


@pytest.mark.parametrize("path", ["/api/stop", "/api/fleet/stop", "/robots/left/api/stop"])
async def test_stops_of_one_link_pass_the_limits_up_to_a_rate_and_anothers_pass_all_the_same(path: str) -> None:
    answered: list[str] = []
    turned_away: list[str] = []
    now = [0.0]
    door = _stop_door(answered, turned_away, now=lambda: now[0])
    for _ in range(1000):
        await _ask(door, "flood", path)
    assert len(answered) == STOP_BURST + 2, "those of its own bucket, and those of the address"
    assert len(turned_away) == 1000 - len(answered)
    for _ in range(STOP_BURST):
        await _ask(door, "other", path)  # of the same address
    assert answered.count("other") == STOP_BURST
    now[0] = 1.0
    for _ in range(1000):
        await _ask(door, "flood", path)
    assert answered.count("flood") == STOP_BURST + 2 + STOP_RATE


async def test_a_silenced_link_has_no_stops_that_pass_the_limits() -> None:
    answered: list[str] = []
    turned_away: list[str] = []
    door = _stop_door(answered, turned_away, silenced=("flood",))
    for _ in range(100):
        await _ask(door, "flood")
    assert (len(answered), len(turned_away)) == (2, 98)
    await _ask(door, "other")
    assert answered[-1] == "other"


@pytest.mark.parametrize(
    ("path", "method", "kind"),
    [
        ("/api/stop", "GET", "http"),
        ("/api/stop", "HEAD", "http"),
        ("/api/stop", "OPTIONS", "http"),
        ("/api/fleet/stop", "DELETE", "http"),
        ("/api/stop/", "POST", "http"),
        ("/api//stop", "POST", "http"),
        ("//api/stop", "POST", "http"),
        ("/robots/left/right/api/stop", "POST", "http"),
        ("/robots/left/robots/left/api/stop", "POST", "http"),
        ("/whep", "POST", "http"),
        ("/api/stop", "", "websocket"),
    ],
)
async def test_nothing_else_that_looks_like_a_stop_passes_the_limits(path: str, method: str, kind: str) -> None:
    answered: list[str] = []
    turned_away: list[str] = []
    door = _stop_door(answered, turned_away)
    for _ in range(50):
        await _ask(door, "flood", path, method, kind)
    assert (len(answered), len(turned_away)) == (2, 48)


async def test_one_link_that_floods_the_stop_loads_nobody_and_the_stops_of_others_are_answered() -> None:
    async with running_rig(max_request_burst=5, max_request_rate=0.001) as rig:
        flood, other = rig.token("observer"), rig.token("observer")
        since = time.monotonic()
        asked = [rig.http.post("/api/stop", headers=flood) for _ in range(200)]
        codes = Counter([answer.status_code for answer in await asyncio.gather(*asked)])
        took = time.monotonic() - since
        assert codes.total() == codes[200] + codes[429]
        assert rig.count("lockstep_stops_total", where="http") == codes[200]
        assert codes[200] <= STOP_BURST + STOP_RATE * took + 5, "however long this took; five are those of the address"
        assert (await rig.http.post("/api/stop", headers=other)).status_code == 200


async def test_who_fails_to_say_who_they_are_too_often_is_told_so_and_others_are_not_disturbed() -> None:
    async with running_rig(max_refused_burst=2, max_refused_rate=0.001) as rig:
        answers = [await rig.http.get("/api/session", headers={"Authorization": "Bearer x"}) for _ in range(3)]
        assert [answer.status_code for answer in answers] == [401, 401, 429]
        assert (await rig.http.get("/api/session", headers=rig.token("observer"))).status_code == 200


async def test_a_websocket_for_a_foreign_name_is_closed_and_other_scopes_pass() -> None:
    passed: list[str] = []
    sent: list[Message] = []
    counted: list[str] = []

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        passed.append(scope["type"])

    async def receive() -> Message:
        raise AssertionError("nothing to receive")

    async def send(message: Message) -> None:
        sent.append(message)

    door = TrustedHost(app, HostNames(()), RateLimits(1, 9), lambda scope, name: counted.append(name), lambda: 0.0)
    await door({"type": "websocket", "path": "/", "headers": [(b"host", b"evil.example")]}, receive, send)
    await door({"type": "lifespan"}, receive, send)
    assert passed == ["lifespan"]
    assert sent == [{"type": "websocket.close", "code": 1008}]
    assert counted == ["host_refused"]


async def test_a_stop_does_not_wait_for_the_turn_of_others() -> None:
    order: list[str] = []

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        order.append(scope["path"])

    async def receive() -> Message:
        raise AssertionError("nothing to receive")

    async def send(message: Message) -> None:
        raise AssertionError("nothing to send")

    def link_of(scope: Scope) -> str:
        return "link" if scope["path"] == "/api/stop" else ""

    door = TrustedHost(app, HostNames(()), RateLimits(1, 9), lambda scope, name: None, lambda: 0.0, link_of=link_of)
    paths = ("/api/session", "/metrics", "/api/invitations", "/api/stop")
    requests = [
        asyncio.create_task(
            door({"type": "http", "method": "POST", "path": path, "headers": [(b"host", b"localhost")]}, receive, send)
        )
        for path in paths
    ]
    await asyncio.gather(*requests)
    assert order.index("/api/stop") < order.index("/metrics")
    assert sorted(order) == sorted(paths)


@pytest.mark.parametrize("host", ["127.0.0.1", "::"])
async def test_an_address_that_a_proxy_forwards_is_the_one_that_counts_and_nobody_elses_word_is(host: str) -> None:
    async with running_rig(host=host, max_request_burst=2, max_request_rate=0.001) as rig:
        for address in ("192.0.2.1", "192.0.2.2", "2001:db8::1"):
            ask = {"X-Forwarded-For": address}
            assert [(await rig.http.get("/", headers=ask)).status_code for _ in range(3)] == [200, 200, 429]
        assert (await rig.http.get("/", headers={"X-Forwarded-For": "2001:db8::ffff"})).status_code == 429
        odd = [(await rig.http.get("/", headers={"X-Forwarded-For": f"x{n}" * 900})).status_code for n in range(3)]
        assert odd == [200, 200, 429], "all that are no addresses count as one"


async def test_a_fault_behind_the_door_is_answered_by_name_counted_and_tells_nothing() -> None:
    async with running_rig() as rig:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("lockstep.server.routes.session.json_answer", lambda *_: 1 / 0)
            answer = await rig.http.get("/api/session", headers=rig.token("observer"))
        assert (answer.status_code, answer.json()["error"]) == (500, "internal_error")
        assert "division" not in answer.text
        assert rig.count("lockstep_internal_errors_total", where="http") == 1
        assert (await rig.http.get("/api/session", headers=rig.token("observer"))).status_code == 200
