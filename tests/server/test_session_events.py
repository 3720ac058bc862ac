"""Events of a session reach their subscribers, and faults of a subscriber reach nobody."""

from lockstep.protocol.messages import Command, Rest
from lockstep.server.audit.records import Actor
from lockstep.server.session_events import CommandForwarded, RestForwarded, SessionEvent, SessionEvents
from lockstep.server.telemetry.metrics import Metrics

COMMAND = CommandForwarded(Actor("Ann"), Command(event=1, issue=1, nonce=1, values=[]))
REST = RestForwarded(Actor("Ann"), Rest(event=1), "")


def _faults(metrics: Metrics, where: str) -> float | None:
    return metrics.registry.get_sample_value("lockstep_internal_errors_total", {"where": where})


def test_an_event_goes_to_the_subscribers_of_its_type_at_once_in_the_order_of_their_subscription() -> None:
    events, heard = SessionEvents(Metrics(process=False).faults), list[tuple[str, SessionEvent]]()
    events.subscribe(CommandForwarded, lambda event: heard.append(("first", event)))
    events.subscribe(RestForwarded, lambda event: heard.append(("rest", event)))
    events.subscribe(CommandForwarded, lambda event: heard.append(("second", event)))
    events.publish(COMMAND)
    assert heard == [("first", COMMAND), ("second", COMMAND)]
    events.publish(REST)
    assert heard[2:] == [("rest", REST)]


def test_an_event_without_subscribers_goes_nowhere() -> None:
    SessionEvents(Metrics(process=False).faults).publish(REST)


def test_a_subscriber_that_fails_is_counted_and_the_next_one_hears_the_event() -> None:
    metrics, heard = Metrics(process=False), list[SessionEvent]()
    events = SessionEvents(metrics.faults)

    def fail(event: CommandForwarded) -> None:
        raise RuntimeError("a fault of a subscriber")

    events.subscribe(CommandForwarded, fail)
    events.subscribe(CommandForwarded, heard.append)
    for _ in range(2):
        events.publish(COMMAND)
    assert heard == [COMMAND, COMMAND]
    assert _faults(metrics, "hearing CommandForwarded") == 2
