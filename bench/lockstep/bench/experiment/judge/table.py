"""Formats results as text, a line for each client and stream. No I/O."""

from collections.abc import Iterable

from lockstep.bench.experiment.judge.results import Result

__all__ = ["COLUMNS", "render_table", "rows_of"]

COLUMNS = (
    "profile",
    "mode",
    "client",
    "stream",
    "received",
    "rendered",
    "discarded",
    "held",
    "largest gap",
    "mean gap",
    "violations",
    "within T",
    "events/s",
    "command → picture",
    "age p50/p95",
)


def rows_of(result: Result) -> list[list[str]]:
    rows = []
    for name, client in result["clients"].items():
        for stream, figures in client["streams"].items():
            delays = client["command_to_picture_ms"] or {}
            is_video = figures["kind"] == "video"
            rows.append(
                [
                    result["profile"],
                    result["mode"],
                    name,
                    stream,
                    str(figures["received"]),
                    _with_share(figures["rendered"], figures["rendered_share"]),
                    str(figures["discarded"]),
                    str(figures["held"]),
                    str(figures["max_gap"]),
                    "–" if figures["mean_gap"] is None else f"{figures['mean_gap']:.2f}",
                    str(figures["violations"]),
                    "–" if figures["within_share"] is None else f"{figures['within_share']:.1%}",
                    f"{client['event_rate']:.1f}",
                    _pair(delays.get("median"), delays.get("p95")) if is_video and delays else "–",
                    _pair(figures["age_ms"]["p50"], figures["age_ms"]["p95"]),
                ]
            )
    return rows


def _with_share(count: int, share: float | None) -> str:
    return str(count) if share is None else f"{count} ({share:.0%})"


def _pair(median: float | None, p95: float | None) -> str:
    return "–" if median is None or p95 is None else f"{median:.0f}/{p95:.0f} ms"


def render_table(results: Iterable[Result]) -> str:
    rows = [list(COLUMNS), *(row for result in results for row in rows_of(result))]
    widths = [max(len(row[column]) for row in rows) for column in range(len(COLUMNS))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )
