"""What is noted of the session while an episode is open, and where it stands."""

from types import SimpleNamespace
from typing import Any

from lockstep.protocol.console import Seat
from lockstep.protocol.messages import Feedback, StopState
from lockstep.server.audit.records import Actor
from lockstep.server.event_clock import EventClock
from lockstep.server.recording.episodes.open_episode import Place
from lockstep.server.recording.episodes.session_place import SessionPlace
from lockstep.server.session_events import FeedbackReceived, ResetDone, SeatChanged, StopShown


def made(thread: Any = None) -> tuple[SessionPlace, EventClock]:
    clock = EventClock()
    recorder: Any = SimpleNamespace(running=thread)
    robot: Any = SimpleNamespace(up=True)
    return SessionPlace(clock, recorder, robot), clock


def seat(holder: str, name: str, why: str = "taken") -> SeatChanged:
    return SeatChanged(Seat(holder=holder, name=name, why=why), Actor(), Actor())


def stop(number: int, *, stopped: bool = True, by: str = "Bo") -> StopShown:
    return StopShown(StopState(stopped=stopped, by=by, number=number), 7)


def test_a_new_holder_of_the_seat_is_noted_and_a_new_name_is_not() -> None:
    place, _ = made()
    assert place.note(seat("p1", "Ada")) == "Ada drives (taken)"
    assert place.note(seat("p1", "Ada L.")) == ""
    assert place.now().driver == "Ada L."
    assert place.note(seat("", "", "left")) == "nobody drives (left)"


def test_each_stop_and_its_reset_are_noted_once() -> None:
    place, _ = made()
    assert place.note(stop(1)) == "stop 1 by Bo"
    assert [place.note(stop(1)), place.note(stop(2, by=""))] == ["", "stop 2 by somebody"]
    assert place.note(ResetDone(Actor("Ada"), "page", 2)) == "stop 2 was reset by Ada"
    assert [place.note(stop(2, stopped=False)), place.note(stop(3))] == ["", "stop 3 by Bo"]


def test_the_place_is_that_of_the_clock_and_of_a_recording_that_runs() -> None:
    thread = SimpleNamespace(running=True, info=SimpleNamespace(recording="r1"))
    place, clock = made(thread)
    clock.begin("e1")
    clock.observe(Feedback(event=9, issue=1, time=1.0, axes=[0.0], joints=[]), 0.0)
    assert place.now() == Place("e1", 9, "r1", True, "")
    thread.running = False
    assert place.now().recording == ""


def test_the_end_of_an_epoch_has_its_last_event() -> None:
    place, clock = made()
    feedback = Feedback(event=9, issue=1, time=1.0, axes=[0.0], joints=[])
    clock.begin("e1")
    clock.observe(feedback, 0.0)
    place.fed_back(FeedbackReceived(feedback, 0.0, None))
    clock.begin("e2")
    assert (place.now().event, place.at_epoch_end().event) == (1, 9)
