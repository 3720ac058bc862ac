"""A made-up run: ten events in a second, a picture and a sound for each."""

from dataclasses import replace
from typing import Any

from lockstep.bench.experiment.choices import Choices
from lockstep.bench.experiment.judge.record import Arrival, ClientRecord, Gate, Rendered, RobotRecord, Run

__all__ = ["choices", "client", "run"]

CAMERA, MICROPHONE = "overview", "microphone"


def choices(**said: Any) -> Choices:
    usual = Choices(profile="micro-lan", mode="feedback", seconds=1.0, tolerance=2, seed=1)
    return replace(usual, **said)


def statistics(received: int, rendered: int, violations: int) -> dict[str, Any]:
    counts = {"received": received, "rendered": rendered, "discarded": received - rendered, "held": 0}
    streams = [{"stream": name, "codec": "VP8", "violations": violations, **counts} for name in (CAMERA, MICROPHONE)]
    return {"streams": streams, "command_to_picture_ms": {"count": 9, "median": 30.0, "p95": 50.04, "p99": 60.0}}


def client(name: str = "operator", gate: Gate = "event", lag: int = 1, *, drives: bool = True) -> ClientRecord:
    """Everything it renders is `lag` events behind."""
    record = ClientRecord(name, "headless", gate, "feedback", drives, 2)
    record.feedbacks = [Arrival(100 + number / 10, 10 + number) for number in range(11)]
    for stream in (CAMERA, MICROPHONE):
        record.rendered[stream] = [
            Rendered(100.05 + number / 10, 10 + number - lag, lag, 10 + number, 0.02) for number in range(10)
        ]
    record.statistics_before = statistics(5, 5, 0)
    record.statistics = statistics(25, 15, 10 if lag > 2 else 0)
    record.drawn_right = 10
    return record


def run(*clients: ClientRecord) -> Run:
    events = [Arrival(100 + number / 10, 10 + number) for number in range(11)]
    robot = RobotRecord(events, events, {CAMERA: events, MICROPHONE: events})
    return Run(100.0, 101.0, robot, list(clients or (client(),)), [CAMERA], [MICROPHONE], {})
