import msgspec
import pytest

from lockstep.protocol.console import Role
from lockstep.server.auth.invitations import MAX_KEPT, MAX_LIVE, MAX_SECONDS, SHOWN_AFTER_END, Invitation, Invitations
from lockstep.server.auth.tokens import Identity
from lockstep.server.errors import BadParameter, NotAllowed, NotFound, TooManyInvitations

NOW = 1_000_000.0
HOUR = 3600.0


def _person(role: Role, link: str = "own", expires: float = NOW + 100 * HOUR) -> Identity:
    return Identity(role, f"a {role}", link, expires)


@pytest.mark.parametrize(
    ("by", "allowed"),
    [
        ("observer", set()),
        ("operator", {"observer", "operator"}),
        ("supervisor", {"observer", "operator", "supervisor"}),
    ],
)
def test_who_may_invite_whom(by: Role, allowed: set[Role]) -> None:
    roles: list[Role] = ["observer", "operator", "supervisor"]
    for role in roles:
        known = Invitations([])
        if role in allowed:
            made = known.invite(_person(by), role, "Ada", HOUR, NOW)
            assert (made.role, made.name, made.by, made.by_link) == (role, "Ada", f"a {by}", "own")
        else:
            with pytest.raises(NotAllowed):
                known.invite(_person(by), role, "Ada", HOUR, NOW)


def test_the_command_line_invites_anyone() -> None:
    made = Invitations([]).invite(None, "supervisor", "", HOUR, NOW)
    assert (made.name, made.by, made.expires) == ("supervisor", "", NOW + HOUR)


@pytest.mark.parametrize("name", ["At the robot", "robot  bridge", "\uff32obot bridge", "r\u043ebot bridge", "Console"])
def test_nobody_is_called_what_the_product_calls_itself(name: str) -> None:
    assert Invitations([]).invite(None, "observer", name, HOUR, NOW).name == "observer"


def test_names_are_cleaned() -> None:
    assert Invitations([]).invite(None, "observer", "  A\u202eda\x00 \n", HOUR, NOW).name == "Ada"


@pytest.mark.parametrize("seconds", [0, 59, -1, MAX_SECONDS + 1, float("inf"), float("nan")])
def test_a_time_out_of_bounds_is_refused(seconds: float) -> None:
    with pytest.raises(BadParameter):
        Invitations([]).invite(None, "observer", "", seconds, NOW)


def test_an_invitation_ends_no_later_than_the_link_it_was_made_with() -> None:
    by = _person("operator", expires=NOW + HOUR)
    assert Invitations([]).invite(by, "observer", "", 8 * HOUR, NOW).expires == NOW + HOUR


def test_they_are_bounded_and_revoked_or_expired_ones_do_not_count() -> None:
    known = Invitations([])
    made = [known.invite(None, "observer", "", HOUR, NOW) for _ in range(MAX_LIVE)]
    with pytest.raises(TooManyInvitations):
        known.invite(None, "observer", "", HOUR, NOW)
    known.revoke(None, made[0].id, NOW)
    known.invite(None, "observer", "", HOUR, NOW)
    known.invite(None, "observer", "", HOUR, NOW + 2 * HOUR)


def test_operators_who_make_links_without_end_leave_room_for_supervisors() -> None:
    supervisor = _person("supervisor", "other")
    known = Invitations([])
    operator = known.for_start("operator", 100 * HOUR, NOW).identity  # printed by the console: it may be everybody's
    for _ in range(MAX_LIVE - MAX_LIVE // 10 - 1):
        known.invite(operator, "observer", "", HOUR, NOW)
    with pytest.raises(TooManyInvitations):
        known.invite(operator, "observer", "", HOUR, NOW)
    made = known.invite(supervisor, "operator", "", HOUR, NOW)
    ended = [msgspec.structs.replace(made, id=str(number), revoked_at=NOW) for number in range(MAX_KEPT)]
    for kept, who in ((0, None), (1, supervisor), (MAX_KEPT // 10 + 1, operator)):
        if who is not None:
            with pytest.raises(TooManyInvitations):
                Invitations(ended[kept - 1 :]).invite(who, "observer", "", HOUR, NOW)
        Invitations(ended[kept:]).invite(who, "observer", "", HOUR, NOW)


@pytest.mark.parametrize("printed", [False, True], ids=["from the command line", "by the printed link"])
def test_a_link_and_all_that_it_invited_make_a_quarter_of_the_links_at_most(printed: bool) -> None:
    known = Invitations([])
    inviter = known.for_start("operator", 100 * HOUR, NOW).identity if printed else None
    one = known.invite(inviter, "operator", "one", 50 * HOUR, NOW).identity
    other = known.invite(inviter, "operator", "other", 50 * HOUR, NOW).identity
    at = one
    for _ in range(MAX_LIVE // 4):  # each invites the next
        at = known.invite(at, "operator", "", HOUR, NOW).identity
    for each in (at, one):
        with pytest.raises(TooManyInvitations, match="your link"):
            known.invite(each, "observer", "", HOUR, NOW)
    known.invite(other, "observer", "", HOUR, NOW)
    known.revoke(None, at.token_id, NOW)
    known.invite(one, "observer", "", HOUR, NOW)


def test_who_invites_and_revokes_without_end_fills_a_quarter_of_what_is_remembered() -> None:
    known = Invitations([])
    one = known.invite(None, "operator", "one", 50 * HOUR, NOW).identity
    for _ in range(MAX_KEPT // 4):
        known.revoke(one, known.invite(one, "observer", "", HOUR, NOW).id, NOW)
    with pytest.raises(TooManyInvitations, match="ask a supervisor"):
        known.invite(one, "observer", "", HOUR, NOW)


def test_an_operator_sees_and_revokes_what_it_invited_and_a_supervisor_everything() -> None:
    known = Invitations([])
    mine = known.invite(_person("operator", "mine"), "observer", "", HOUR, NOW)
    other = known.invite(_person("operator", "other"), "observer", "", HOUR, NOW + 1)
    assert known.visible(_person("operator", "mine")) == [mine]
    assert known.visible(_person("observer", "mine")) == [mine]
    assert known.visible(_person("supervisor")) == known.visible(None) == [other, mine]
    with pytest.raises(NotFound):
        known.revoke(_person("operator", "mine"), other.id, NOW)
    assert known.revoke(_person("supervisor"), other.id, NOW)[0].revoked_at == NOW
    assert known.revoked() == {other.id}


def test_what_was_invited_with_a_revoked_link_is_revoked_with_it() -> None:
    known = Invitations([])
    first = known.invite(None, "operator", "", HOUR, NOW)
    second = known.invite(first.identity, "operator", "", HOUR, NOW)
    third = known.invite(second.identity, "observer", "", HOUR, NOW)
    apart = known.invite(None, "observer", "", HOUR, NOW)
    assert {each.id for each in known.revoke(None, first.id, NOW)} == {first.id, second.id, third.id}
    assert apart.id not in known.revoked()
    assert known.revoke(None, first.id, NOW + 1) == [], "once is enough"


def test_a_circle_of_invitations_ends() -> None:
    known = Invitations(
        [
            Invitation(id="a", role="operator", name="", created=NOW, expires=NOW + 9, by_link="b"),
            Invitation(id="b", role="operator", name="", created=NOW, expires=NOW + 9, by_link="a"),
        ]
    )
    assert len(known.revoke(None, "a", NOW)) == 2


def test_the_link_of_the_start_is_the_same_until_half_of_its_time_is_over() -> None:
    known = Invitations([])
    first = known.for_start("operator", 10 * HOUR, NOW)
    assert known.for_start("operator", 10 * HOUR, NOW + 5 * HOUR) == first
    assert known.for_start("operator", 10 * HOUR, NOW + 5.1 * HOUR) != first
    assert known.for_start("observer", 10 * HOUR, NOW) != first


def test_what_expired_long_ago_is_forgotten_and_a_revoked_one_is_kept_until_it_would_have_expired() -> None:
    known = Invitations([])
    revoked = known.invite(None, "observer", "", HOUR, NOW)
    known.revoke(None, revoked.id, NOW)
    known.prune(NOW + HOUR + SHOWN_AFTER_END - 1)
    assert known.revoked() == {revoked.id}
    known.prune(NOW + HOUR + SHOWN_AFTER_END)
    assert known.all == []


def test_a_link_for_some_robots_invites_for_no_other() -> None:
    known, by = Invitations([]), _person("operator")._replace(robots=("left", "right"))
    assert known.invite(by, "observer", "", HOUR, NOW).robots == ("left", "right")
    assert known.invite(by, "observer", "", HOUR, NOW, ("left",)).robots == ("left",)
    with pytest.raises(NotAllowed):
        known.invite(by, "observer", "", HOUR, NOW, ("left", "middle"))


@pytest.mark.parametrize("robots", [("A",), ("",), ("a/b",), tuple(f"r{number}" for number in range(33))])
def test_robots_that_cannot_be_are_refused(robots: tuple[str, ...]) -> None:
    with pytest.raises(BadParameter):
        Invitations([]).invite(None, "observer", "", HOUR, NOW, robots)


def test_a_supervisor_of_some_robots_sees_and_revokes_only_what_is_good_for_no_other() -> None:
    known, by = Invitations([]), _person("supervisor")._replace(robots=("left", "right"))
    inside = known.invite(None, "observer", "", HOUR, NOW, ("left",))
    partly = known.invite(None, "observer", "", HOUR, NOW, ("left", "middle"))
    everywhere = known.invite(None, "observer", "", HOUR, NOW)
    assert known.visible(by) == [inside]
    for other in (partly, everywhere):
        with pytest.raises(NotFound):
            known.revoke(by, other.id, NOW)
    assert [each.id for each in known.revoke(by, inside.id, NOW)] == [inside.id]
