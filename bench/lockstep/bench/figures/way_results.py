"""Results of a way's spans (docs/traces.md): a stacked figure, each part on top of those before it. No I/O."""

from collections.abc import Mapping, Sequence
from typing import Any

from lockstep.bench.figures.results import Result
from lockstep.bench.figures.samples import median
from lockstep.protocol.trace import Span

__all__ = ["sum_of_medians", "way_results"]


def way_results(
    section: str, title: str, way: Sequence[Span], traced: Sequence[Mapping[str, float]], **fields: Any
) -> list[Result]:
    """Return a row with the median of each span that was measured, in ms, in the order of the way.

    Args:
        title: "planar: picture"
        traced: the spans of each picture or command, by name
    """
    rows: list[Result] = []
    begin = 0.0
    for span in way:
        values = [each[span.name] for each in traced if span.name in each]
        if not values:
            continue
        rows.append(
            Result(
                section=section,
                name=f"{title}: {span.clock}, {span.name.removesuffix('_ms').replace('_', ' ')}",
                value=median(values),
                unit="ms",
                samples=len(values),
                stacked_on=begin,
                **fields,
            )
        )
        begin += median(values)
    return rows


def sum_of_medians(rows: Sequence[Result]) -> float:
    """Return where the stacked figure ends, in ms."""
    return sum(row.value or 0.0 for row in rows)
