import subprocess
import sys
import time

import jwt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.server.auth.tokens import Access, Identity, Right, require_role
from lockstep.server.errors import (
    LinkExpired,
    LinkOtherRobot,
    LinkRevoked,
    NotAllowed,
    StateUnavailable,
    TokenInvalid,
    TokenMissing,
)

SECRET = "a secret of at least thirty-two bytes"
ACCESS = Access(SECRET, 60, 60)
SOON = time.time() + 3600


def _link(token_id: str = "link", expires: float = SOON) -> Identity:
    return Identity("operator", "Ada", token_id, expires)


CLAIMS = {"aud": "lockstep", "exp": 2**40, "iat": 1, "role": "operator", "name": "x", "jti": "1"}


def test_a_token_stands_for_its_role_and_name() -> None:
    identity = ACCESS.verify(ACCESS.issue("observer", "Ada"))
    assert (identity.role, identity.name) == ("observer", "Ada")
    assert identity.token_id


def test_the_claims_of_these_tests_would_be_taken() -> None:
    assert ACCESS.verify(jwt.encode(CLAIMS, SECRET, "HS256")).role == "operator"


def test_every_token_has_an_id_of_its_own() -> None:
    assert ACCESS.verify(ACCESS.issue("observer", "")).token_id != ACCESS.verify(ACCESS.issue("observer", "")).token_id


@pytest.mark.parametrize(
    "token",
    [
        "",
        "x",
        "a.b.c",
        Access("another secret of thirty-two bytes", 60, 60).issue("operator", "x"),
        ACCESS.issue_ticket(_link()),
        jwt.encode(CLAIMS | {"role": "admin"}, SECRET, "HS256"),
        jwt.encode(CLAIMS | {"role": ["operator"]}, SECRET, "HS256"),
        jwt.encode(CLAIMS | {"name": 1}, SECRET, "HS256"),
        jwt.encode({key: value for key, value in CLAIMS.items() if key != "exp"}, SECRET, "HS256"),
        jwt.encode({key: value for key, value in CLAIMS.items() if key != "role"}, SECRET, "HS256"),
        jwt.encode(CLAIMS | {"aud": "another"}, SECRET, "HS256"),
        jwt.encode(CLAIMS | {"aud": ["lockstep"]}, SECRET, "HS256"),
        jwt.encode(CLAIMS | {"exp": "4000000000"}, SECRET, "HS256"),
        jwt.encode(CLAIMS | {"exp": True}, SECRET, "HS256"),
        jwt.encode(CLAIMS | {"jti": ""}, SECRET, "HS256"),
        jwt.encode(CLAIMS | {"name": "x" * 61}, SECRET, "HS256"),
        jwt.encode(CLAIMS | {"admin": True}, SECRET, "HS256"),
        jwt.encode(CLAIMS, "", "none"),
        ACCESS.issue("operator", "x" * 4000),
    ],
)
def test_any_other_token_is_refused_in_the_same_words(token: str) -> None:
    with pytest.raises(TokenInvalid) as refused:
        ACCESS.verify(token)
    assert refused.value.detail == "the token is not valid"


@given(st.text())
def test_no_text_gets_in_or_raises_anything_else(text: str) -> None:
    with pytest.raises(TokenInvalid):
        ACCESS.verify(text)


@given(st.integers(0, 400), st.characters())
def test_a_token_with_one_character_changed_never_gives_another_role(place: int, character: str) -> None:
    token = ACCESS.issue("observer", "x")
    changed = token[: place % len(token)] + character + token[place % len(token) + 1 :]
    try:
        identity = ACCESS.verify(changed)
    except TokenInvalid:
        return
    assert identity.role == "observer"  # the last character's spare bits do not count


@pytest.mark.parametrize("header", [None, "", "Basic abc", "Bearer", "Bearer   "])
def test_no_bearer_token_is_said_so(header: str | None) -> None:
    with pytest.raises(TokenMissing):
        ACCESS.bearer(header)


def test_the_scheme_may_be_written_in_any_case() -> None:
    assert ACCESS.bearer(f"bearer {ACCESS.issue('operator', 'x')}").role == "operator"


def test_a_ticket_opens_the_scene_and_a_token_does_not() -> None:
    ACCESS.verify_ticket(ACCESS.issue_ticket(_link()))
    with pytest.raises(TokenInvalid):
        ACCESS.verify_ticket(ACCESS.issue("operator", "x"))


def test_only_who_holds_a_link_of_ours_is_told_that_it_ended() -> None:
    with pytest.raises(LinkExpired):
        ACCESS.verify(Access(SECRET, -1, 60).issue("operator", "x"))
    access = Access(SECRET, 60, 60, is_revoked={"gone"}.__contains__)
    gone = Identity("operator", "x", "gone", time.time() + 60)
    with pytest.raises(LinkRevoked):
        access.verify(access.sign(gone, 0.0))
    with pytest.raises(LinkExpired):
        access.verify(access.sign(gone._replace(expires=1.0), 0.0))
    with pytest.raises(TokenInvalid):
        ACCESS.verify(Access("another secret of thirty-two bytes", -1, 60).issue("operator", "x"))


def test_a_ticket_ends_with_its_link() -> None:
    access = Access(SECRET, 60, 60, is_revoked={"gone"}.__contains__)
    assert access.verify_ticket(access.issue_ticket(_link("good"))) == ("good", "operator", SOON)
    with pytest.raises(LinkRevoked):
        access.verify_ticket(access.issue_ticket(_link("gone")))


def test_the_same_identity_is_always_the_same_token() -> None:
    identity = Identity("observer", "Ada", "id", 2.0**40)
    assert ACCESS.sign(identity, 5.0) == ACCESS.sign(identity, 5.0)
    assert ACCESS.verify(ACCESS.sign(identity, 5.0)) == identity._replace(issued=5.0)


def test_a_ticket_expires() -> None:
    with pytest.raises(LinkExpired):
        ACCESS.verify_ticket(Access(SECRET, 60, -1).issue_ticket(_link()))


def test_a_role_is_required_where_it_is() -> None:
    require_role(ACCESS.verify(ACCESS.issue("operator", "x")), "operator")
    with pytest.raises(NotAllowed):
        require_role(ACCESS.verify(ACCESS.issue("observer", "x")), "operator", "supervisor")


def test_a_link_for_some_robots_opens_these_and_no_other() -> None:
    token = ACCESS.issue("operator", "x", ("left", "right"))
    assert ACCESS.at("left").verify(token).robots == ("left", "right")
    assert ACCESS.at(None).verify(token).may_see("right")
    for other in ("middle", ""):
        with pytest.raises(LinkOtherRobot):
            ACCESS.at(other).verify(token)


def test_a_link_that_names_no_robot_opens_all_and_is_the_same_token_as_ever() -> None:
    token = ACCESS.issue("operator", "x")
    for robot in ("left", "", None):
        assert ACCESS.at(robot).verify(token).robots == ()
    assert "robots" not in jwt.decode(token, options={"verify_signature": False})


def test_a_ticket_of_one_robot_opens_nothing_of_another() -> None:
    left, right = ACCESS.at("left"), ACCESS.at("right")
    assert left.verify_ticket(left.issue_ticket(_link())).link == "link"
    left.verify_file_ticket(left.issue_file_ticket("r1", _link()), "r1")
    for other in (right, ACCESS):
        with pytest.raises(TokenInvalid):
            other.verify_ticket(left.issue_ticket(_link()))
        with pytest.raises(TokenInvalid):
            other.verify_file_ticket(left.issue_file_ticket("r1", _link()), "r1")


FIRST_TOKENS = """
import os, sys, threading
from lockstep.server.auth.tokens import Access
access = Access("a secret of at least thirty-two bytes", 60, 60)
token = access.issue("operator", "Ada")
sys.setswitchinterval(1e-6)
for _ in range(20):
    child = os.fork()
    if child == 0:
        together = threading.Barrier(8)
        def verify():
            together.wait()
            access.verify(token)
        threads = [threading.Thread(target=verify) for _ in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0, "the interpreter crashed"
"""


def test_the_first_tokens_of_a_process_can_be_verified_by_several_threads_at_once() -> None:
    done = subprocess.run([sys.executable, "-c", FIRST_TOKENS], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


class _Clock:
    """A clock that is set by hand."""

    def __init__(self, now: float) -> None:
        self.now = now

    def __call__(self) -> float:
        return self.now


def test_tickets_end_with_their_link_though_they_would_be_good_for_longer() -> None:
    clock = _Clock(1000.0)
    access = Access(SECRET, 60, 600, now=clock)
    scene, file = access.issue_ticket(_link("a", 1060.0)), access.issue_file_ticket("r1", _link("a", 1060.0))
    assert access.verify_ticket(scene).ends == 1060.0
    right = access.verify_file_ticket(file, "r1")
    assert right.token_id == "a"
    clock.now = 1060.0
    with pytest.raises(LinkExpired):
        access.verify_ticket(scene)
    with pytest.raises(LinkExpired):
        access.verify_file_ticket(file, "r1")
    with pytest.raises(LinkExpired):
        right.role  # noqa: B018


def test_a_right_is_asked_anew_each_time() -> None:
    clock, revoked = _Clock(1000.0), set[str]()
    access = Access(SECRET, 60, 60, is_revoked=revoked.__contains__, now=clock)
    one, other = (access.bearer(f"Bearer {access.issue('operator', name)}") for name in ("Ada", "Bob"))
    assert (one.name, one.role, one.actor.name) == ("Ada", "operator", "Ada")
    revoked.add(one.token_id)
    for attribute in ("identity", "role", "name", "token_id", "actor"):
        with pytest.raises(LinkRevoked):
            getattr(one, attribute)
    assert other.name == "Bob"
    clock.now += 60
    with pytest.raises(LinkExpired):
        other.identity  # noqa: B018


def test_while_nobody_knows_which_links_are_revoked_nobody_gets_in_and_who_was_in_may_do_nothing_but_stop() -> None:
    trouble = [""]
    access = Access(SECRET, 60, 60, is_revoked={"gone"}.__contains__, trouble=lambda: trouble[0])
    header = f"Bearer {access.issue('operator', 'Ada')}"
    scene, file = access.issue_ticket(_link()), access.issue_file_ticket("r1", _link())
    right = access.bearer(header)
    trouble[0] = "Permission denied"
    for attempt in (
        lambda: access.bearer(header),
        lambda: access.verify(header.partition(" ")[2]),
        lambda: access.verify_ticket(scene),
        lambda: access.verify_file_ticket(file, "r1"),
        lambda: right.actor,
    ):
        with pytest.raises(StateUnavailable, match="Permission denied"):
            attempt()
    assert access.bearer_to_stop(header).name == "Ada"
    gone = access.sign(_link("gone"), time.time())
    with pytest.raises(LinkRevoked):
        access.bearer_to_stop(f"Bearer {gone}")


def test_a_right_made_by_hand_checks_before_it_says_anything() -> None:
    asked: list[Identity] = []
    right = Right(_link(), asked.append)
    assert (right.role, right.token_id) == ("operator", "link")
    assert asked == [_link()] * 2
