"""Computes the figures of a run from the records of its clients. No I/O."""

from collections.abc import Iterable, Sequence

from lockstep.bench.experiment.judge.record import Arrival, Rendered
from lockstep.bench.figures.samples import quantile
from lockstep.protocol.serial import event_gap

__all__ = ["Spread", "beyond", "event_rate", "share_within", "spread"]

Spread = dict[str, float | None]


def spread(samples: Iterable[float], scale: float = 1000.0) -> Spread:
    """Return percentiles, in ms for samples in s."""
    found = [sample * scale for sample in samples]
    if not found:
        return {"p50": None, "p95": None, "p99": None, "max": None}
    return {
        "p50": round(quantile(found, 0.5), 2),
        "p95": round(quantile(found, 0.95), 2),
        "p99": round(quantile(found, 0.99), 2),
        "max": round(max(found), 2),
    }


def event_rate(feedbacks: Sequence[Arrival]) -> float:
    """Return the events a second between the first and the last feedback."""
    if len(feedbacks) < 2 or feedbacks[-1].at <= feedbacks[0].at:
        return 0.0
    return event_gap(feedbacks[-1].event, feedbacks[0].event) / (feedbacks[-1].at - feedbacks[0].at)


def beyond(rendered: Iterable[Rendered], tolerance: int) -> int:
    """Count the renderings outside the tolerance from feedback and stamp alone, without the gate's verdict."""
    return sum(
        abs(event_gap(each.feedback, each.stamp)) > tolerance
        for each in rendered
        if each.feedback is not None and each.stamp is not None
    )


def share_within(
    feedbacks: Sequence[Arrival], rendered: Sequence[Rendered], tolerance: int, until: float
) -> float | None:
    """Return the share of time from the first picture on in which the picture on screen is within tolerance.

    A picture stays on screen until the next one, while newer feedback comes. None without any picture.
    """
    steps: list[tuple[float, int, bool]] = [(each.at, each.stamp, True) for each in rendered if each.stamp is not None]
    if not steps:
        return None
    began = steps[0][0]
    steps += [(each.at, each.event, False) for each in feedbacks]
    within = 0.0
    shown: int | None = None
    newest: int | None = None
    previous = began
    for at, event, is_picture in [*sorted(steps), (until, 0, False)]:
        if shown is not None and newest is not None and abs(event_gap(newest, shown)) <= tolerance:
            within += max(0.0, min(at, until) - max(previous, began))
        if is_picture:
            shown = event
        elif event:
            newest = event
        previous = at
    return within / (until - began) if until > began else None
