"""What log lines look like; in processes of their own, since logging is set up once in each."""

import json
import subprocess
import sys
from contextvars import copy_context

from lockstep.protocol.messages import Feedback
from lockstep.server.event_clock import EventClock
from lockstep.server.telemetry.log_context import LogContext, add_session, follow_clock

PROGRAM = """
import logging, structlog
from lockstep.protocol.messages import Feedback
from lockstep.server.event_clock import EventClock
from lockstep.server.telemetry.log_context import follow_clock
from lockstep.server.telemetry.logs import LogFormat, configure_logs
configure_logs(logging.INFO, LogFormat({form!r}))
clock = EventClock()
follow_clock(clock)
log = structlog.get_logger("x")
log.info("before")
clock.begin("e1")
clock.observe(Feedback(event=7, issue=1, time=0.0, axes=[]), 0.0)
structlog.contextvars.bind_contextvars(peer="a1")
log.warning("a stop", reason="why")
logging.getLogger("library").warning("its %s words", "own")
try:
    raise RuntimeError("a fault")
except RuntimeError:
    log.exception("it failed")
log.debug("not shown")
"""


def _lines(form: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(form=form)], capture_output=True, text=True, check=True, timeout=50
    )
    assert done.stdout == "", "standard output carries only what was asked for"
    return done.stderr.splitlines()


def test_as_json_every_line_has_its_session_and_event_where_they_are_known() -> None:
    before, stop, library, fault = [json.loads(line) for line in _lines("json")]
    assert (before["message"], before["level"], "event" in before) == ("before", "info", False)
    assert (stop["message"], stop["epoch"], stop["event"], stop["peer"]) == ("a stop", "e1", 7, "a1")
    assert stop["reason"] == "why"
    assert stop["timestamp"].endswith("Z")
    assert (library["message"], library["logger"], library["level"]) == ("its own words", "library", "warning")
    assert "RuntimeError: a fault" in fault["exception"]


def test_as_text_people_read_the_same() -> None:
    lines = _lines("text")
    assert "event='a stop'" in lines[1]
    assert "epoch='e1'" in lines[1]
    assert "s=7" in lines[1]
    assert "WARNING library: its own words" in lines


async def test_a_request_before_the_console_runs_is_served_without_a_clock() -> None:
    served = []

    async def app(scope: object, receive: object, send: object) -> None:
        served.append(scope)

    class State:
        state = object()

    for scope in ({"type": "http"}, {"type": "http", "app": State()}):
        await LogContext(app)(scope, None, None)  # type: ignore[arg-type]
    assert len(served) == 2


def test_what_a_line_says_itself_stands() -> None:
    clock = EventClock()
    clock.begin("e1")
    clock.observe(Feedback(event=7, issue=1, time=0.0, axes=[]), 0.0)

    def line() -> object:
        follow_clock(clock)
        return add_session(None, "info", {"epoch": "e0"})

    assert copy_context().run(line) == {"epoch": "e0", "s": 7}
