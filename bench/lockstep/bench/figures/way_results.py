"""Results of a way's spans (docs/traces.md): a stacked figure, each part on top of those before it. No I/O."""

from collections.abc import Mapping, Sequence
from typing import Any

from lockstep.bench.figures.results import Result
from lockstep.protocol.traces.trace import Span

__all__ = ["sum_of_spans", "way_results"]


def way_results(
    section: str, title: str, way: Sequence[Span], traced: Sequence[Mapping[str, float]], **fields: Any
) -> list[Result]:
    """Return a row for each span that was measured, in ms, in the order of the way.

    A value is the mean over the middle half of the ways, by their total. So the rows add up to a usual way; medians of
    the spans would not.

    Args:
        title: "planar: picture"
        traced: the spans of each picture or command, by name; one that was not measured took no time
    """
    names = [span.name for span in way]
    ordered = sorted(traced, key=lambda each: sum(each.get(name, 0.0) for name in names))
    quarter = len(ordered) // 4
    middle = ordered[quarter : len(ordered) - quarter]
    rows: list[Result] = []
    begin = 0.0
    for span in way:
        if not any(span.name in each for each in middle):
            continue
        value = sum(each.get(span.name, 0.0) for each in middle) / len(middle)
        where = "" if span.clock == "between" else f"{span.clock}, "
        rows.append(
            Result(
                section=section,
                name=f"{title}: {where}{span.name.removesuffix('_ms').replace('_', ' ')}",
                value=value,
                unit="ms",
                samples=len(ordered),
                stacked_on=begin,
                **fields,
            )
        )
        begin += value
    return rows


def sum_of_spans(rows: Sequence[Result]) -> float:
    """Return where the stacked figure ends, in ms."""
    return sum(row.value or 0.0 for row in rows)
