"""The entries of one agent, whose sessions share paths."""

from random import Random

from lockstep.rtc.addresses import Path
from lockstep.rtc.ice.agent import Agent
from lockstep.rtc.ice.directory import Directory, Entries

PATH = Path(("192.0.2.1", 5000), ("198.51.100.7", 5000))


def agent() -> Agent:
    return Agent([], controlling=True, rng=Random(1))


def test_a_path_is_given_up_when_the_last_session_gives_it_up() -> None:
    directory, owner = Directory(), agent()
    entries = Entries(directory, owner)
    entries.hint(PATH, "first")
    entries.claim(PATH, "second")
    entries.release(PATH, "first")
    assert directory.owner(PATH) is owner
    entries.release(PATH, "second")
    assert directory.owner(PATH) is None
    assert directory.size == 0


def test_a_path_that_another_agent_has_claimed_stays_with_that_one() -> None:
    directory, owner, other = Directory(), agent(), agent()
    entries = Entries(directory, owner)
    entries.claim(PATH, "session")
    Entries(directory, other).claim(PATH, "session")
    entries.release(PATH, "session")
    assert directory.owner(PATH) is other
