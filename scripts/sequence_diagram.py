"""Sequence diagrams of Mermaid as SVG that needs no script, for the documentation's site.

It knows what the documents use: participants, messages between two of them, and messages to oneself.
"""

import re
from dataclasses import dataclass
from html import escape
from itertools import pairwise

__all__ = ["DiagramError", "render_sequence"]

PARTICIPANT = re.compile(r"participant (\w+)(?: as (.+))?")
MESSAGE = re.compile(r"(\w+)(--?>>)(\w+): ?(.+)")
CHARACTER = 7.4  # px, the widest mean of the site's text in its font size
MARGIN, ROW, HEAD, LEAST = 12, 46, 34, 110
LOOP = 34  # px that a message to oneself stands out


class DiagramError(ValueError):
    """A line is none of those that this module knows."""


@dataclass(frozen=True)
class _Message:
    source: int
    target: int
    text: str
    dashed: bool


def render_sequence(text: str) -> str:
    """Return the SVG of a Mermaid sequence diagram; its colours are those of the text around it.

    Raises:
        DiagramError: the text has a line that is neither a participant nor a message.
    """
    names, messages = _parse(text)
    places = _places(list(names.values()), messages)
    bottom = HEAD + MARGIN + ROW * len(messages) + MARGIN
    width = places[-1] + _reach(list(names.values()), messages)
    parts = [part for name, x in zip(names.values(), places, strict=True) for part in _lifeline(name, x, bottom)]
    for row, message in enumerate(messages):
        parts += _arrow(message, places, HEAD + MARGIN + ROW * row + ROW * 0.7)
    label = escape("; ".join(f"{row}: {message.text}" for row, message in enumerate(messages, start=1)), quote=True)
    return (
        f'<div class="sequence"><svg role="img" aria-label="{label}" viewBox="0 0 {width:.0f} {bottom:.0f}" '
        f'width="{width:.0f}" height="{bottom:.0f}">{"".join(parts)}</svg></div>'
    )


def _parse(text: str) -> tuple[dict[str, str], list[_Message]]:
    names: dict[str, str] = {}
    messages: list[_Message] = []
    head, *lines = [line.strip() for line in text.strip().splitlines()]
    if head != "sequenceDiagram":
        raise DiagramError(f"not a sequence diagram: {head}")
    for line in lines:
        if found := PARTICIPANT.fullmatch(line):
            names[found[1]] = found[2] or found[1]
        elif (found := MESSAGE.fullmatch(line)) and found[1] in names and found[3] in names:
            order = list(names)
            messages.append(_Message(order.index(found[1]), order.index(found[3]), found[4], found[2] == "-->>"))
        else:
            raise DiagramError(f"neither a participant nor a message between participants: {line}")
    return names, messages


def _width(text: str) -> float:
    return CHARACTER * len(text)


def _places(names: list[str], messages: list[_Message]) -> list[float]:
    """The middle of each participant: neighbours have room for their names and for what stands between them."""
    gaps = [max(LEAST, (_width(left) + _width(right)) / 2 + 3 * MARGIN) for left, right in pairwise(names)]
    for message in messages:
        first, last = sorted((message.source, message.target))
        if first == last:
            if first < len(gaps):
                gaps[first] = max(gaps[first], LOOP + _width(message.text) + 2 * MARGIN)
        else:
            missing = _width(message.text) + 3 * MARGIN - sum(gaps[first:last])
            for number in range(first, last):
                gaps[number] += max(0.0, missing) / (last - first)
    places = [_width(names[0]) / 2 + 2 * MARGIN]
    for gap in gaps:
        places.append(places[-1] + gap)
    return places


def _reach(names: list[str], messages: list[_Message]) -> float:
    """What stands right of the last participant's middle."""
    last = len(names) - 1
    own = [LOOP + _width(each.text) for each in messages if each.source == each.target == last]
    return max([_width(names[-1]) / 2 + MARGIN, *own]) + MARGIN


def _lifeline(name: str, x: float, bottom: float) -> list[str]:
    half = _width(name) / 2 + MARGIN
    return [
        f'<line class="life" x1="{x:.1f}" x2="{x:.1f}" y1="{HEAD}" y2="{bottom:.1f}"/>',
        f'<rect x="{x - half:.1f}" y="1" width="{2 * half:.1f}" height="{HEAD - 2}" rx="6"/>',
        f'<text class="name" x="{x:.1f}" y="{HEAD / 2 + 4:.1f}">{escape(name)}</text>',
    ]


def _arrow(message: _Message, places: list[float], y: float) -> list[str]:
    kind = ' class="dashed"' if message.dashed else ""
    start, end = places[message.source], places[message.target]
    if message.source == message.target:
        text = f'<text class="own" x="{start + LOOP + 6:.1f}" y="{y - 3:.1f}">{escape(message.text)}</text>'
        path = f"M{start:.1f} {y - 16:.1f}h{LOOP - 6}v16H{start + 7:.1f}"
        return [text, f'<path{kind} d="{path}"/>', _head(start, y, 1)]
    text = f'<text x="{(start + end) / 2:.1f}" y="{y - 8:.1f}">{escape(message.text)}</text>'
    way = 1 if start > end else -1
    return [text, f'<path{kind} d="M{start:.1f} {y:.1f}H{end + 7 * way:.1f}"/>', _head(end, y, way)]


def _head(x: float, y: float, way: int) -> str:
    """The point of an arrow; `way` is 1 where its shaft lies to the right."""
    return f'<path class="head" d="M{x:.1f} {y:.1f}l{9 * way} -4.5v9z"/>'
