from hypothesis import given
from hypothesis import strategies as st

from lockstep.server.recording.format.drivers import NOBODY, EventDriver, EventDrivers

HUMAN, POLICY = ("Ada", "human"), ("net", "policy")


def _executed(drivers: EventDrivers, event: int, who: tuple[str, str]) -> EventDriver:
    drivers.forwarded("e", event, *who)  # type: ignore[arg-type]
    return drivers.executed("e", event)


def test_an_event_is_driven_by_the_sender_of_its_command_and_by_nobody_without_one() -> None:
    drivers = EventDrivers()
    assert drivers.executed("e", 1) == NOBODY
    assert _executed(drivers, 2, POLICY) == EventDriver("net", "policy")
    assert drivers.executed("e", 3) == NOBODY
    drivers.forwarded("e", 4, *HUMAN)  # type: ignore[arg-type]
    assert drivers.executed("another run", 4) == NOBODY


def test_a_later_issue_of_an_event_has_the_same_driver() -> None:
    drivers = EventDrivers()
    first = _executed(drivers, 2, POLICY)
    drivers.forwarded("e", 3, *HUMAN)  # type: ignore[arg-type]
    assert drivers.executed("e", 2) == first


def test_a_person_intervenes_only_after_a_policy_in_the_same_episode() -> None:
    drivers = EventDrivers()
    _executed(drivers, 2, POLICY)
    assert not _executed(drivers, 3, HUMAN).intervention
    drivers.episode(begins=True)
    assert not _executed(drivers, 4, HUMAN).intervention
    assert not _executed(drivers, 5, POLICY).intervention
    assert _executed(drivers, 6, HUMAN) == EventDriver("Ada", "human", intervention=True)
    assert not _executed(drivers, 7, POLICY).intervention
    assert _executed(drivers, 8, HUMAN).intervention
    drivers.episode(begins=False)
    assert not _executed(drivers, 9, HUMAN).intervention
    drivers.episode(begins=True)
    assert not _executed(drivers, 10, HUMAN).intervention


@given(st.lists(st.sampled_from(["human", "policy", "begin", "end"]), max_size=30))
def test_interventions_are_what_they_are_said_to_be(what: list[str]) -> None:
    drivers = EventDrivers()
    for number, each in enumerate(what):
        if each in ("begin", "end"):
            drivers.episode(begins=each == "begin")
            continue
        driver = _executed(drivers, number + 2, HUMAN if each == "human" else POLICY)
        since = [at for at, other in enumerate(what[:number]) if other in ("begin", "end")]
        in_episode = bool(since) and what[since[-1]] == "begin"
        corrected = in_episode and "policy" in what[since[-1] : number] and each == "human"
        assert driver == EventDriver("Ada" if each == "human" else "net", each, corrected)  # type: ignore[arg-type]
