"""Summarises a drive in figures."""

from collections.abc import Sequence

from lockstep.bench.figures.samples import quantile
from lockstep.bench.quality.freezes import freezes
from lockstep.bench.quality.stage import Drive

__all__ = ["summarise", "timeline"]


def summarise(drive: Drive, seconds: float) -> dict[str, float | int | None]:
    """Return the figures of a drive; times in ms, shares in %."""
    delays = [delay * 1000 for _, delay in drive.delays]
    gaps = [sight.gap for sight in drive.sights if sight.gap is not None]
    queues = [sight.queue * 1000 for sight in drive.sights]
    within = sum(abs(gap) <= drive.tolerance for gap in gaps)
    rendered = sum(abs(picture.gap) <= drive.tolerance for picture in drive.pictures)
    frozen = freezes([picture.at for picture in drive.pictures if abs(picture.gap) <= drive.tolerance])
    return {
        "events": drive.events,
        "lost_after_seconds": None if drive.lost_at is None else round(drive.lost_at, 1),
        "pictures": len(drive.pictures),
        "pictures_in_tolerance_percent": _share(rendered, len(drive.pictures)),
        "time_with_picture_in_tolerance_percent": _share(within, len(drive.sights)),
        "delay_median_ms": _rank(delays, 0.5),
        "delay_p95_ms": _rank(delays, 0.95),
        "delay_worst_ms": _rank(delays, 1.0),
        "queue_median_ms": _rank(queues, 0.5),
        "queue_p95_ms": _rank(queues, 0.95),
        "queue_worst_ms": _rank(queues, 1.0),
        "freezes_per_minute": round(len(frozen) * 60 / seconds, 1),
        "frozen_seconds_per_minute": round(sum(frozen) * 60 / seconds, 2),
        "largest_gap": max((abs(picture.gap) for picture in drive.pictures), default=None),
    }


def timeline(drive: Drive, seconds: float, step: float = 0.5) -> dict[str, list[float | None]]:
    """Return, by intervals of `step` s, the longest command-to-picture delay and queue (ms) and the widest picture."""
    count = int(seconds / step)
    delays: list[float | None] = [None] * count
    queues: list[float | None] = [None] * count
    widths: list[float | None] = [None] * count
    for at, delay in drive.delays:
        _raise(delays, at / step, delay * 1000)
    for sight in drive.sights:
        _raise(queues, sight.at / step, sight.queue * 1000)
    for picture in drive.pictures:
        _raise(widths, picture.at / step, picture.width)
    return {"at": [i * step for i in range(count)], "delay_ms": delays, "queue_ms": queues, "width": widths}


def _raise(series: list[float | None], index: float, value: float) -> None:
    i = int(index)
    if 0 <= i < len(series):
        series[i] = round(max(series[i] or 0.0, value), 1)


def _share(part: int, whole: int) -> float:
    return round(part / whole * 100, 2) if whole else 0.0


def _rank(values: Sequence[float], share: float) -> float | None:
    return round(quantile(list(values), share), 1) if values else None
