"""Two agents over bad paths: whatever is lost, late, doubled or out of order, they meet and stay together."""

import pytest

from lockstep.rtc.ice.agent import Agent
from lockstep.rtc.ice.events import Ended, PathChanged, RestartFailed
from tests.rtc.ice.network import Conditions, Network, agent_at, candidates_of, connect

pytestmark = pytest.mark.slow

BAD = {
    "loss of 30 %": Conditions(loss=0.3, delay=(0.02, 0.05)),
    "600 ms round trip": Conditions(delay=(0.3, 0.3)),
    "2 s round trip": Conditions(delay=(1.0, 1.0)),
    "4 s round trip": Conditions(delay=(2.0, 2.0)),
    "reordered by up to 2 s": Conditions(delay=(0.0, 2.0), duplicates=0.2),
    "2 s round trip and loss of 20 %": Conditions(loss=0.2, delay=(0.9, 1.1), duplicates=0.1),
    "everything": Conditions(loss=0.3, delay=(0.0, 2.0), duplicates=0.3),
}


def together(network: Network, here: Agent, there: Agent) -> bool:
    """Both send on one nominated path."""
    if here.path is None or there.path is None:
        return False
    same = here.path.local == there.path.remote and here.path.remote == there.path.local
    return same and all(
        next(event for event in reversed(network.events[each]) if isinstance(event, PathChanged)).nominated
        for each in (here, there)
    )


@pytest.mark.parametrize("name", BAD)
@pytest.mark.parametrize("seed", range(3))
def test_two_agents_meet_and_stay_together_for_an_hour(name: str, seed: int) -> None:
    network = Network(seed, BAD[name])
    here = agent_at("192.0.2.1", "2001:db8::1", controlling=seed % 2 == 0, seed=seed)
    there = agent_at("198.51.100.7", "2001:db8::7", controlling=seed % 3 == 0, seed=seed)
    connect(network, here, there)
    assert network.run(40, lambda: together(network, here, there))
    network.run(3600)
    assert together(network, here, there)
    assert here.role.controlling is not there.role.controlling
    assert_small(here)
    assert_small(there)


@pytest.mark.parametrize("name", BAD)
@pytest.mark.parametrize("seed", range(2))
def test_restarts_over_bad_paths_never_leave_an_agent_without_one(name: str, seed: int) -> None:
    network = Network(seed, BAD[name])
    here, there = agent_at("192.0.2.1", controlling=True, seed=seed), agent_at("198.51.100.7", seed=seed)
    connect(network, here, there)
    assert network.run(40, lambda: together(network, here, there))
    for _ in range(5):
        here.restart(network.now)
        there.restart(network.now)
        for one, other in ((here, there), (there, here)):
            one.set_remote(other.local_credentials, candidates_of(other), network.now)
            network.drain(one)
        network.run(60)
        assert together(network, here, there)
    for each in (here, there):
        assert RestartFailed() not in network.events[each]
        assert PathChanged(None, nominated=False) not in network.events[each]
        assert_small(each)


@pytest.mark.parametrize("seed", range(4))
def test_cuts_of_twelve_seconds_every_minute_are_survived(seed: int) -> None:
    network = Network(seed, Conditions(loss=0.05, delay=(0.05, 0.3)))
    here, there = agent_at("192.0.2.1", controlling=True, seed=seed), agent_at("198.51.100.7", seed=seed)
    connect(network, here, there)
    assert network.run(40, lambda: together(network, here, there))
    for _ in range(60):
        network.run(48)
        network.conditions.cut = True
        network.run(12)
        network.conditions.cut = False
    assert together(network, here, there)
    assert not any(isinstance(event, Ended) for event in network.events[here] + network.events[there])


@pytest.mark.parametrize("seed", range(4))
def test_a_cut_while_they_look_for_a_path_delays_them_only(seed: int) -> None:
    network = Network(seed, Conditions(delay=(0.1, 0.3)))
    here, there = agent_at("192.0.2.1", controlling=True, seed=seed), agent_at("198.51.100.7", seed=seed)
    network.conditions.cut = True
    connect(network, here, there)
    network.run(20)
    network.conditions.cut = False
    assert network.run(19, lambda: together(network, here, there))


def assert_small(agent: Agent) -> None:
    """Some checks under way, and the pairs of at most two sessions."""
    assert agent._directory.size < 40
