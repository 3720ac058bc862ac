"""Who drove each event: a person, a policy, or nobody, and whether a person corrected a policy. No I/O, no clock.

An event is driven by the sender of the command that became it, whoever holds the seat when its feedback arrives.

An *intervention* is an event of a person in an episode in which a policy has driven before: a correction. What a person
does before the policy's first event of the episode is none, and outside of episodes there are none.
"""

from typing import NamedTuple

from lockstep.protocol.console import DriverKind

__all__ = ["NOBODY", "EventDriver", "EventDrivers"]


class EventDriver(NamedTuple):
    """The driver of one event."""

    name: str = ""  # as others saw it; a person or a policy may call itself anything
    kind: DriverKind = "none"  # by the role of the link
    intervention: bool = False


NOBODY = EventDriver()


class EventDrivers:
    """Call `forwarded`, `episode` and `executed` in the order in which these things happen."""

    def __init__(self) -> None:
        self._sent: tuple[str, int, EventDriver] = ("", 0, NOBODY)  # epoch and event of the newest command
        self._executed: tuple[str, int, EventDriver] = ("", 0, NOBODY)
        self._in_episode = False
        self._policy_drove = False  # in the episode that is open

    def forwarded(self, epoch: str, event: int, name: str, kind: DriverKind) -> None:
        """Take a command that went to the robot, and is to become `event`."""
        self._sent = epoch, event, EventDriver(name, kind)

    def episode(self, *, begins: bool) -> None:
        """Take the begin or the end of an episode, however it ends."""
        self._in_episode, self._policy_drove = begins, False

    def executed(self, epoch: str, event: int) -> EventDriver:
        """Take a feedback of `event`, and return its driver: for each issue of the same event the same."""
        if self._executed[:2] == (epoch, event):
            return self._executed[2]
        driver = self._sent[2] if self._sent[:2] == (epoch, event) else NOBODY
        if self._in_episode and driver.kind == "human":
            driver = driver._replace(intervention=self._policy_drove)
        self._policy_drove = self._policy_drove or (self._in_episode and driver.kind == "policy")
        self._executed = epoch, event, driver
        return driver
