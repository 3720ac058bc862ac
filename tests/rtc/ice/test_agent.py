"""Two agents on one virtual clock."""

import hmac
from collections.abc import Callable
from random import Random

import pytest

from lockstep.rtc.addresses import Address, Path
from lockstep.rtc.ice.agent import Agent
from lockstep.rtc.ice.candidates import Candidate, parse_candidate
from lockstep.rtc.ice.credentials import new_credentials
from lockstep.rtc.ice.events import Ended, PathChanged, RestartFailed
from lockstep.rtc.ice.gathering import Advertised, gather
from lockstep.rtc.ice.settings import IceSettings
from lockstep.rtc.stun import Kind, Message, StunErrorCode, parse, serialize
from tests.rtc.ice.network import Conditions, Network, agent_at, candidates_of, connect

HERE, THERE = ("192.0.2.1", 5000), ("198.51.100.7", 5000)
ONE_WAY = 0.01


def connected() -> tuple[Network, Agent, Agent]:
    """The one here controls. Both have a nominated path."""
    network = Network()
    here, there = agent_at(HERE[0], controlling=True), agent_at(THERE[0])
    connect(network, here, there)
    assert network.run(10, lambda: settled(network, here) and settled(network, there))
    return network, here, there


def settled(network: Network, agent: Agent) -> bool:
    return PathChanged(agent.path, nominated=True) in network.events[agent]


def ends(network: Network, agent: Agent) -> list[Ended]:
    return [event for event in network.events[agent] if isinstance(event, Ended)]


def test_a_path_works_after_one_round_trip_and_is_nominated_after_two() -> None:
    network = Network()
    here, there = agent_at(HERE[0], controlling=True), agent_at(THERE[0])
    connect(network, here, there)
    assert network.run(2 * ONE_WAY + 1e-6, lambda: here.path is not None)
    assert network.run(2 * ONE_WAY + 1e-6, lambda: settled(network, here))
    assert here.path == Path(HERE, THERE)
    assert there.path == Path(THERE, HERE)


@pytest.mark.parametrize("version", ["2001:db8::1", "192.0.2.1"])
def test_both_versions_of_ip_work(version: str) -> None:
    network = Network()
    other = "2001:db8::7" if ":" in version else "198.51.100.7"
    here, there = agent_at(version, controlling=True), agent_at(other)
    connect(network, here, there)
    assert network.run(5, lambda: settled(network, here) and settled(network, there))


def test_whoever_hears_of_the_peer_later_is_found_by_its_checks() -> None:
    """The answer overtakes nothing: the peer's checks come before its candidates do."""
    network = Network()
    here, there = network.add(agent_at(HERE[0], controlling=True)), network.add(agent_at(THERE[0]))
    here.set_remote(there.local_credentials, candidates_of(there), network.now)
    network.run(1)
    assert there.accepts(Path(THERE, HERE)), "data may come with the check"
    assert there.path is None
    there.set_remote(here.local_credentials, [], network.now)
    assert network.run(3, lambda: settled(network, here) and settled(network, there))


def test_a_peer_behind_a_nat_is_found_without_a_candidate() -> None:
    network = Network()
    here, there = agent_at("10.0.0.9", controlling=True), agent_at(THERE[0])
    network.translate = nat("10.0.0.9", "203.0.113.50", 61000)
    connect(network, here, there)
    assert network.run(5, lambda: settled(network, here) and settled(network, there))
    assert there.path == Path(THERE, ("203.0.113.50", 61000))


def nat(inner: str, outer: str, port: int) -> Callable[[Path], Path | None]:
    """A NAT before one host: nobody reaches its inner address, and whoever it has sent to reaches the outer one."""
    opened: set[Address] = set()

    def translate(path: Path) -> Path | None:
        if path.local[0] == inner:
            opened.add(path.remote)
            return Path((outer, port), path.remote)
        if path.remote == (outer, port):
            return Path(path.local, (inner, 5000)) if path.local in opened else None
        return None if path.remote[0] == inner else path

    return translate


def test_a_peer_whose_nat_gives_it_another_port_is_followed_at_its_next_check() -> None:
    network = Network()
    here, there = agent_at("10.0.0.9", controlling=True), agent_at(THERE[0])
    network.translate = nat("10.0.0.9", "203.0.113.50", 61000)
    connect(network, here, there)
    assert network.run(5, lambda: settled(network, there))
    network.translate = nat("10.0.0.9", "203.0.113.50", 62000)
    assert network.run(12, lambda: there.path == Path(THERE, ("203.0.113.50", 62000)))
    network.run(120)
    assert not ends(network, here)
    assert not ends(network, there)


def test_a_peer_that_moves_again_and_again_is_followed_every_time() -> None:
    network = Network()
    here, there = agent_at("10.0.0.9", controlling=True), agent_at(THERE[0])
    network.translate = nat("10.0.0.9", "203.0.113.50", 61000)
    connect(network, here, there)
    for port in range(61001, 61101):
        network.translate = nat("10.0.0.9", "203.0.113.50", port)
        moved = Path(THERE, ("203.0.113.50", port))
        assert network.run(12, lambda moved=moved: there.path == moved)  # type: ignore[misc]
    assert there._directory.size < 60
    assert not ends(network, here)
    assert not ends(network, there)


def test_an_advertised_address_is_a_way_in() -> None:
    network = Network()
    there = Agent(gather(["10.0.0.5"], 5000, advertised=[Advertised("203.0.113.7")]), controlling=False, rng=Random(1))
    here = agent_at(HERE[0], controlling=True)

    def one_to_one(path: Path) -> Path | None:
        if path.local[0] == "10.0.0.5":
            return Path(("203.0.113.7", path.local[1]), path.remote)
        if path.remote[0] == "203.0.113.7":
            return Path(path.local, ("10.0.0.5", path.remote[1]))
        return None

    network.translate = one_to_one
    connect(network, here, there)
    assert network.run(5, lambda: settled(network, here) and settled(network, there))
    assert there.path == Path(("10.0.0.5", 5000), HERE)


@pytest.mark.parametrize("both", [True, False])
@pytest.mark.parametrize("seed", range(4))
def test_two_agents_of_one_role_settle_who_controls(both: bool, seed: int) -> None:
    network = Network()
    here = agent_at(HERE[0], controlling=both, seed=seed)
    there = agent_at(THERE[0], controlling=both, seed=seed + 10)
    connect(network, here, there)
    assert network.run(10, lambda: settled(network, here) and settled(network, there))
    assert here.role.controlling is not there.role.controlling


def test_the_better_of_two_paths_is_nominated() -> None:
    network = Network()
    here, there = agent_at(HERE[0], "192.0.2.2", controlling=True), agent_at(THERE[0])
    connect(network, here, there)
    network.run(5)
    assert here.path == Path(HERE, THERE)
    assert there.path == Path(THERE, HERE)


def test_a_path_that_nothing_passes_is_not_waited_for() -> None:
    network = Network()
    here, there = agent_at(HERE[0], "192.0.2.2", controlling=True), agent_at(THERE[0])
    network.translate = lambda path: None if HERE in path else path
    connect(network, here, there)
    assert network.run(1, lambda: settled(network, here) and settled(network, there))
    assert here.path == Path(("192.0.2.2", 5000), THERE)


def test_without_any_path_both_end_and_say_so() -> None:
    network = Network(conditions=Conditions(cut=True))
    here, there = agent_at(HERE[0], controlling=True), agent_at(THERE[0])
    connect(network, here, there)
    network.run(39)
    assert ends(network, here) == []
    network.run(2)
    assert ends(network, here) == ends(network, there) == [Ended("no_path")]
    assert here.timer() is None


def test_a_check_is_sent_seven_times_and_ever_more_seldom() -> None:
    network = Network(conditions=Conditions(cut=True))
    here, there = agent_at(HERE[0], controlling=True), agent_at(THERE[0])
    connect(network, here, there)
    began = network.now
    network.run(60)
    times = [round(at - began, 3) for at, datagram in network.sent if datagram.local == HERE]
    assert times == [0.0, 0.5, 1.5, 3.5, 7.5, 15.5, 31.5]


def test_names_are_counted_and_ignored_and_the_peer_is_found_by_its_checks() -> None:
    network = Network()
    here, there = network.add(agent_at(HERE[0], controlling=True)), network.add(agent_at(THERE[0]))
    hidden = parse_candidate("candidate:1 1 udp 2113937151 0b1e7a1c-5f5c-4f2a.local 51000 typ host")
    here.set_remote(there.local_credentials, candidates_of(there), network.now)
    there.set_remote(here.local_credentials, [hidden], network.now)
    assert network.run(5, lambda: settled(network, here) and settled(network, there))
    assert there.counts["candidate_with_a_name"] == 1


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("candidate:1 2 udp 1 203.0.113.7 5000 typ host", "candidate_of_another_component"),
        ("candidate:1 1 udp 1 203.0.113.7 0 typ host", "candidate_unreachable"),
        ("candidate:1 1 udp 1 203.0.113.7 5000 typ host ufrag other", "candidate_of_another_session"),
    ],
)
def test_candidates_that_are_of_no_use_are_counted(line: str, reason: str) -> None:
    agent = agent_at(HERE[0])
    agent.set_remote(new_credentials(), [parse_candidate(line)], 0.0)
    assert agent.counts[reason] == 1


def test_a_peer_may_name_only_so_many_candidates() -> None:
    agent = agent_at(HERE[0], controlling=True)
    many = [Candidate("1", 1, "udp", 1 + place, "203.0.113.7", 1 + place, "host") for place in range(1000)]
    agent.set_remote(new_credentials(), many, 0.0)
    assert agent.counts["candidate_not_added"] == 1000 - 32
    addresses = set()
    for tick in range(5000):
        agent.handle_timer(tick * 0.01)
        addresses |= {datagram.remote for datagram in agent.datagrams_to_send()}
    assert len(addresses) == 32


def test_the_pairs_to_check_are_bounded_and_the_best_stay() -> None:
    agent = agent_at(*(f"192.0.2.{number}" for number in range(1, 9)), controlling=True)
    many = [Candidate("1", 1, "udp", 1 + place, "203.0.113.7", 1 + place, "host") for place in range(32)]
    agent.set_remote(new_credentials(), many, 0.0)
    checked = []
    for tick in range(1000):
        agent.handle_timer(tick * 0.01)
        checked += [datagram.path for datagram in agent.datagrams_to_send()]
    assert len(set(checked)) == 100
    assert checked[0].remote == ("203.0.113.7", 32)


def test_a_check_that_is_refused_is_not_repeated_until_the_peer_checks() -> None:
    network = Network(conditions=Conditions(cut=True))
    here, there = agent_at(HERE[0], controlling=True), agent_at(THERE[0])
    connect(network, here, there)
    network.run(0.1)
    question = parse(next(each.data for _, each in network.sent if each.local == HERE))
    refusal = Message(Kind.ERROR, question.transaction, error=StunErrorCode(400))
    network.inject(serialize(refusal, there.local_credentials.password), Path(HERE, THERE))
    began = len(network.sent)
    network.run(10)
    assert not [each for _, each in network.sent[began:] if each.local == HERE]
    network.conditions.cut = False
    assert network.run(20, lambda: settled(network, here))


# Consent


def test_an_hour_without_traffic_keeps_consent() -> None:
    network, here, there = connected()
    began = len(network.sent)
    network.run(3600)
    assert not ends(network, here)
    assert not ends(network, there)
    checks = [datagram for _, datagram in network.sent[began:] if parse(datagram.data).kind is Kind.REQUEST]
    assert 2 * 3600 / 6 <= len(checks) <= 2 * 3600 / 4, "one in 4 to 6 s in each direction"


def test_silence_ends_an_agent_after_thirty_seconds_and_no_sooner() -> None:
    network, here, there = connected()
    network.run(60)
    network.conditions.cut = True
    network.run(23.9)
    assert not ends(network, here)
    network.run(6.2)
    assert ends(network, here) == ends(network, there) == [Ended("consent_expired")]
    assert here.path is None


def test_a_cut_of_twenty_three_seconds_is_survived_again_and_again() -> None:
    network, here, there = connected()
    for _ in range(20):
        network.conditions.cut = True
        network.run(23)
        network.conditions.cut = False
        network.run(7)
    assert not ends(network, here)
    assert not ends(network, there)


def test_answers_that_come_after_twelve_seconds_keep_consent() -> None:
    network, here, there = connected()
    network.conditions.delay = (12.0, 12.0)
    network.run(600)
    assert not ends(network, here)
    assert not ends(network, there)


def test_checks_of_the_peer_keep_consent_where_answers_are_lost() -> None:
    network, here, there = connected()

    def without_answers_to_here(path: Path) -> Path | None:
        kind = parse(network.sent[-1][1].data).kind
        return None if kind is Kind.SUCCESS and path.remote == HERE else path

    network.translate = without_answers_to_here
    network.run(600)
    assert not ends(network, here)


def test_a_recorded_check_keeps_no_consent() -> None:
    network, here, there = connected()
    recorded = next(
        datagram.data
        for _, datagram in network.sent
        if datagram.remote == HERE and parse(datagram.data).kind is Kind.REQUEST
    )
    network.conditions.cut = True
    for _ in range(40):
        network.run(1)
        if not here.ended:
            network.inject(recorded, Path(HERE, THERE))
    assert ends(network, here) == [Ended("consent_expired")]


def test_an_answer_counts_once_and_only_with_the_password() -> None:
    network, here, there = connected()
    recorded = [datagram for _, datagram in network.sent if datagram.remote == HERE]
    answer = next(each.data for each in recorded if parse(each.data).kind is Kind.SUCCESS)
    network.conditions.cut = True
    for _ in range(40):
        network.run(1)
        for _, question in network.sent[-3:]:
            if question.local == HERE and not here.ended:
                forged = Message(Kind.SUCCESS, parse(question.data).transaction, mapped=HERE)
                network.inject(serialize(forged, "guessed"), Path(HERE, THERE))
                network.inject(serialize(forged), Path(HERE, THERE))
                network.inject(answer, Path(HERE, THERE))
    assert ends(network, here) == [Ended("consent_expired")]
    assert here.counts["unauthentic"] > 0
    assert here.counts["unknown_transaction"] > 0


def test_an_answer_from_elsewhere_is_none() -> None:
    network, here, there = connected()
    network.translate = lambda path: Path(("203.0.113.66", 1), path.remote) if path.local == THERE else path
    network.run(40)
    assert ends(network, here) == [Ended("consent_expired")]
    assert here.counts["unexpected_response"] > 0


# Restart


def restart(network: Network, here: Agent, there: Agent) -> None:
    here.restart(network.now)
    there.restart(network.now)
    for one, other in ((here, there), (there, here)):
        one.set_remote(other.local_credentials, candidates_of(other), network.now)
        network.drain(one)


def test_a_restart_has_new_credentials_and_ends_on_a_path() -> None:
    network, here, there = connected()
    before = here.local_credentials
    network.events[here].clear()
    restart(network, here, there)
    assert here.local_credentials != before
    assert here.path is not None
    network.run(2)
    assert here.local_credentials.ufrag not in (before.ufrag,)
    network.run(120)
    assert not ends(network, here)
    assert not ends(network, there)
    assert here.path == Path(HERE, THERE)


def test_the_old_path_carries_until_the_new_one_is_nominated_and_is_heard_for_a_while() -> None:
    network = Network()
    here, there = agent_at(HERE[0], "192.0.2.2", controlling=True), agent_at(THERE[0])
    connect(network, here, there)
    assert network.run(5, lambda: settled(network, here) and settled(network, there))
    second = ("192.0.2.2", 5000)
    network.translate = lambda path: None if HERE in path else path
    network.conditions.delay = (0.3, 0.3)
    restart(network, here, there)
    paths = []
    while here.path != Path(second, THERE) or there.path != Path(THERE, second):
        paths.append(here.path)
        assert network.step(network.now + 5)
    assert Path(HERE, THERE) in paths
    assert None not in paths
    assert there.accepts(Path(THERE, HERE)), "what is under way is not lost"
    network.run(31)
    assert not there.accepts(Path(THERE, HERE))
    assert not ends(network, here)


def test_a_restart_that_finds_no_path_changes_nothing() -> None:
    network, here, there = connected()
    here.restart(network.now)
    here.set_remote(new_credentials(), [], network.now)
    network.run(45)
    assert RestartFailed() in network.events[here]
    assert here.path == Path(HERE, THERE)
    network.run(120)
    assert not ends(network, here)


def test_a_restart_that_is_cancelled_changes_nothing() -> None:
    network, here, there = connected()
    before = here.local_credentials
    here.restart(network.now)
    here.cancel_restart()
    assert here.local_credentials == before
    network.run(120)
    assert not ends(network, here)


def test_a_restart_after_the_path_is_lost_finds_another() -> None:
    network, here, there = connected()
    network.conditions.cut = True
    network.run(20)
    here.restart(network.now)
    there.restart(network.now)
    network.run(15)
    assert here.path is None, "consent has expired"
    assert not ends(network, here), "a restart is under way"
    network.conditions.cut = False
    for one, other in ((here, there), (there, here)):
        one.set_remote(other.local_credentials, candidates_of(other), network.now)
    assert network.run(5, lambda: here.path is not None and there.path is not None)
    network.run(120)
    assert not ends(network, here)


def test_a_restart_that_is_never_answered_keeps_no_agent_alive() -> None:
    network, here, there = connected()
    here.restart(network.now)
    network.conditions.cut = True
    network.run(45)
    assert network.events[here][-1] == Ended("consent_expired")
    assert here.timer() is None


def test_other_credentials_without_a_restart_are_refused() -> None:
    network, here, there = connected()
    with pytest.raises(RuntimeError, match="restart"):
        here.set_remote(new_credentials(), [], network.now)
    here.set_remote(there.local_credentials, [], network.now)


# Nomination by peers that go on nominating


def nominate(network: Network, here: Agent, there: Agent, remote: tuple[str, int]) -> None:
    """A check with USE-CANDIDATE by `there`'s credentials, from an address that answers."""
    credentials, mine = here.local_credentials, there.local_credentials
    check = Message(
        Kind.REQUEST,
        network.rng.randbytes(12),
        username=f"{credentials.ufrag}:{mine.ufrag}",
        priority=1,
        use_candidate=True,
        controlling=1,
    )
    network.inject(serialize(check, credentials.password), Path(HERE, remote))


def test_a_worse_path_that_is_nominated_is_used_only_when_the_better_one_is_dead() -> None:
    network, there, here = Network(), agent_at(THERE[0], "10.0.0.7", controlling=True), agent_at(HERE[0])
    connect(network, there, here)
    assert network.run(5, lambda: settled(network, here))
    worse = ("10.0.0.7", 5000)
    nominate(network, here, there, worse)
    network.run(3)
    nominate(network, here, there, worse)
    network.run(3)
    assert here.path == Path(HERE, THERE), "it answers"
    network.translate = lambda path: None if THERE in path else path
    nominate(network, here, there, worse)
    assert network.run(3, lambda: here.path == Path(HERE, worse))


def recorded_checks(network: Network) -> list[bytes]:
    return [each.data for _, each in network.sent if each.remote == HERE and parse(each.data).kind is Kind.REQUEST]


def test_a_recorded_nomination_does_not_move_a_path_back() -> None:
    network = Network()
    there, here = agent_at("10.0.0.9", controlling=True), agent_at(HERE[0])
    network.translate = nat("10.0.0.9", "203.0.113.50", 61000)
    connect(network, there, here)
    assert network.run(5, lambda: settled(network, here))
    network.translate = nat("10.0.0.9", "203.0.113.50", 62000)
    assert network.run(12, lambda: here.path == Path(HERE, ("203.0.113.50", 62000)))
    for data in recorded_checks(network):
        network.inject(data, Path(HERE, ("203.0.113.50", 61000)))
        assert here.path == Path(HERE, ("203.0.113.50", 62000))


def test_recorded_checks_that_flood_an_agent_do_not_keep_it_from_answering_its_peer() -> None:
    network = Network()
    few = IceSettings(max_checks_per_second=2, check_burst=4)
    here, there = agent_at(HERE[0], controlling=True, settings=few), agent_at(THERE[0])
    connect(network, here, there)
    assert network.run(10, lambda: settled(network, here) and settled(network, there))
    network.run(60)
    recorded = recorded_checks(network)
    for turn in range(6000):  # for a minute, 100 a second
        network.inject(recorded[turn % len(recorded)], Path(HERE, THERE))
        network.run(0.01)
    assert here.counts["checks_over_rate"] > 5000
    recent = [datagram for at, datagram in network.sent if at > network.now - 50]
    answered = {parse(each.data).transaction for each in recent if parse(each.data).kind is Kind.SUCCESS}
    asked = [parse(each.data) for each in recent[: len(recent) // 2] if each.local == THERE]
    asked = [each for each in asked if each.kind is Kind.REQUEST]
    assert len(asked) >= 3
    assert all(each.transaction in answered for each in asked)


# What peers with the password may do


def check_by(network: Network, here: Agent, there: Agent, **changes: object) -> bytes:
    credentials = here.local_credentials
    fields: dict[str, object] = {
        "username": f"{credentials.ufrag}:{there.local_credentials.ufrag}",
        "priority": 1,
        "controlled": 1,
    }
    check = Message(Kind.REQUEST, network.rng.randbytes(12), **(fields | changes))  # type: ignore[arg-type]
    return serialize(check, credentials.password)


def answer_to(network: Network, here: Agent, data: bytes, path: Path) -> Message:
    network.inject(data, path)
    return parse(network.sent[-1][1].data)


def test_checks_without_what_they_need_are_answered_with_an_error() -> None:
    network, here, there = connected()
    path = Path(HERE, THERE)
    assert answer_to(network, here, check_by(network, here, there, priority=None), path).error == StunErrorCode(
        400, "Bad Request"
    )
    assert answer_to(network, here, check_by(network, here, there, method=3), path).error == StunErrorCode(
        400, "Bad Request"
    )


def test_a_check_with_an_attribute_that_must_be_understood_is_answered_with_its_name() -> None:
    network, here, there = connected()
    data = bytearray(check_by(network, here, there))
    # PRIORITY becomes 0x7024, of which nobody knows anything; the integrity is made anew.
    unsigned = bytes(data[:-32]).replace(b"\x00\x24\x00\x04", b"\x70\x24\x00\x04")
    answer = answer_to(network, here, signed(unsigned, here.local_credentials.password), Path(HERE, THERE))
    assert answer.error is not None
    assert answer.error.code == 420
    assert answer.unknown_attributes == (0x7024,)


def signed(data: bytes, password: str) -> bytes:
    head = data[:2] + (len(data) - 20 + 24).to_bytes(2) + data[4:]
    return head + bytes.fromhex("00080014") + hmac.digest(password.encode(), head, "sha1")


def test_checks_from_very_many_addresses_are_bounded_and_do_not_take_the_path() -> None:
    network, here, there = connected()
    for number in range(2000):
        network.inject(check_by(network, here, there), Path(HERE, (f"203.0.113.{number % 250 + 1}", 1024 + number)))
        network.run(0.03)
    assert here.path == Path(HERE, THERE)
    assert len(here._sessions.current._list.pairs) <= 100
    assert here._directory.size < 200
    network.run(120)
    assert not ends(network, here)
    assert not ends(network, there)


def test_answers_are_sent_at_a_bounded_rate() -> None:
    network, here, there = connected()
    began = len(network.sent)
    for _ in range(1000):
        network.inject(check_by(network, here, there), Path(HERE, THERE))
    assert len(network.sent) - began <= IceSettings().check_burst
    assert here.counts["checks_over_rate"] >= 900


def test_a_check_that_is_recorded_and_sent_from_elsewhere_changes_no_path() -> None:
    network, here, there = connected()
    network.run(60)
    recorded = [each.data for _, each in network.sent if each.remote == HERE and parse(each.data).kind is Kind.REQUEST]
    for number in range(1000):
        network.inject(recorded[number % len(recorded)], Path(HERE, (f"203.0.113.{number % 250 + 1}", 1024 + number)))
        network.run(0.1)
        assert here.path == Path(HERE, THERE)
    assert here._directory.size < 200


def test_a_repetition_that_comes_by_another_port_of_the_nat_is_heard() -> None:
    """The nomination is under way when the NAT changes, so that the peer repeats it with one transaction."""
    network = Network()
    here, there = agent_at("10.0.0.9", controlling=True), agent_at(THERE[0])
    network.translate = nat("10.0.0.9", "203.0.113.50", 61000)
    connect(network, here, there)
    assert network.run(5, lambda: settled(network, there))
    assert not settled(network, here)
    network.lose_what_is_under_way()
    network.translate = nat("10.0.0.9", "203.0.113.50", 62000)
    assert network.run(2, lambda: settled(network, here))
    assert network.run(2, lambda: there.path == Path(THERE, ("203.0.113.50", 62000)))


def test_an_agent_that_ends_leaves_nothing_behind() -> None:
    network, here, there = connected()
    restart(network, here, there)
    network.run(2)
    restart(network, here, there)
    here.close()
    here.close()
    assert here._directory.size == 0
    assert here.timer() is None
    network.inject(check_by(network, there, here), Path(HERE, THERE))
    assert here.datagrams_to_send() == []


def test_the_end_of_a_tcp_connection_ends_its_path_and_the_peer_may_come_again() -> None:
    network = Network()
    passive = Agent(gather([HERE[0]], 5000, tcp_port=5000), controlling=False, rng=Random(1))
    network.add(passive)
    peer = new_credentials(Random(2).randbytes)
    passive.set_remote(peer, [], network.now)
    first, second = (Path(HERE, (THERE[0], port), "tcp") for port in (40000, 40001))
    for path in (first, second):
        check = Message(
            Kind.REQUEST,
            network.rng.randbytes(12),
            username=f"{passive.local_credentials.ufrag}:{peer.ufrag}",
            priority=1,
            use_candidate=True,
            controlling=1,
        )
        network.inject(serialize(check, passive.local_credentials.password), path)
        passive.handle_timer(network.now)
        network.drain(passive)
        question = parse(network.sent[-1][1].data)
        assert question.kind is Kind.REQUEST
        network.inject(serialize(Message(Kind.SUCCESS, question.transaction, mapped=HERE), peer.password), path)
        assert passive.accepts(path)
        changes = [each for each in network.events[passive] if isinstance(each, PathChanged)]
        assert changes[-1] == PathChanged(path, nominated=True)
        network.run(1)
        passive.path_closed(path, network.now)
        network.drain(passive)
        assert network.events[passive][-1] == PathChanged(None, nominated=False)
        assert not passive.accepts(path)
    network.run(40)
    network.drain(passive)
    assert ends(network, passive) == [Ended("consent_expired")]


def test_the_end_of_a_path_of_the_session_before_a_restart_makes_that_one_ask_nothing() -> None:
    network = Network(conditions=Conditions(delay=(0.1, 0.1)))
    here, there = agent_at(HERE[0], "192.0.2.2", controlling=True), agent_at(THERE[0])
    connect(network, here, there)
    assert network.run(10, lambda: settled(network, here))
    network.run(1)
    restart(network, here, there)
    network.run(2)
    assert here.path is not None
    here.path_closed(here.path, network.now)
    network.drain(here)
    network.run(10)
    assert here.path is not None
    assert not ends(network, here)
