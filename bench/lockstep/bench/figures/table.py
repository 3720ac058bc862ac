"""Formats results as tables for people: plain text, and Markdown for docs/performance.md."""

from collections.abc import Iterable, Sequence
from itertools import groupby

from lockstep.bench.figures.results import Result

__all__ = ["render_markdown", "render_table"]

BAR = 40  # characters of the longest stacked figure
HEADINGS = ("", "value", "target", "", "baseline", "ratio")


def render_table(results: Sequence[Result]) -> str:
    """Return a table with columns as wide as needed; under each section the conditions that its figures share."""
    rows = [_cells(result) for result in results]
    widths = [max(len(row[column]) for row in [HEADINGS, *rows]) for column in range(len(HEADINGS))]
    lines = [_line(HEADINGS, widths)]
    for section, group in groupby(results, key=lambda result: result.section):
        members = list(group)
        lines += ["", section]
        longest = max((_end(member) for member in members), default=0.0)
        lines += [_line(_cells(member), widths) + _bar(member, longest) for member in members]
        lines += [f"  · {text}" for text in _unique(member.conditions for member in members)]
        lines += [f"  · baseline: {text}" for text in _unique(member.baseline_name for member in members)]
    return "\n".join(line.rstrip() for line in lines) + "\n"


def render_markdown(results: Sequence[Result]) -> str:
    """Return a table for each section, its conditions, and the command that repeats it."""
    lines: list[str] = []
    for section, group in groupby(results, key=lambda result: result.section):
        members = list(group)
        lines += [f"### {section}", "", f"`{members[0].command}`", ""]
        lines += ["| | measured | target | | baseline | ratio |", "|---|--:|--:|---|--:|--:|"]
        lines += [_row(member) for member in members]
        lines.append("")
        lines += [f"- {text}" for text in _unique(member.conditions for member in members)]
        lines += [f"- baseline: {text}" for text in _unique(member.baseline_name for member in members)]
        lines.append("")
    return "\n".join(lines)


def _row(result: Result) -> str:
    name, value, target, met, baseline, ratio = (cell.strip() for cell in _cells(result))
    return f"| {name} | {value} | {target} | {f'**{met}**' if met == 'MISSED' else met} | {baseline} | {ratio} |"


def _cells(result: Result) -> tuple[str, ...]:
    target = "" if result.target is None else f"{'≤' if result.bound == 'at most' else '≥'} {_number(result.target)}"
    met = {None: "", True: "met", False: "MISSED"}[result.met]
    value = "not measured" if result.value is None else f"{_number(result.value)} {result.unit}"
    baseline = "" if result.baseline is None else f"{_number(result.baseline)} {result.unit}"
    ratio = "" if result.ratio is None else f"{result.ratio:.2f}"
    return f"  {result.name}", value, target, met, baseline, ratio


def _end(result: Result) -> float:
    return 0.0 if result.stacked_on is None else result.stacked_on + (result.value or 0.0)


def _bar(result: Result, longest: float) -> str:
    """Draw a part of a stacked figure, where the parts above it end; at least a stroke."""
    if result.stacked_on is None or longest <= 0:
        return ""
    begin, end = (round(BAR * each / longest) for each in (result.stacked_on, _end(result)))
    return "   " + " " * begin + ("█" * (end - begin) or "▏")


def _number(value: float) -> str:
    """Return three significant digits, without an exponent."""
    size = abs(value)
    if value == int(value) and size < 1e6 or size >= 100:
        return f"{value:.0f}"
    return f"{value:.1f}" if size >= 10 else f"{value:.2f}" if size >= 0.1 else f"{value:.3f}"


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    first, *others = zip(cells, widths, strict=True)
    return first[0].ljust(first[1]) + "".join(f"  {cell.rjust(width)}" for cell, width in others)


def _unique(texts: Iterable[str]) -> list[str]:
    return [text for text in dict.fromkeys(texts) if text]
