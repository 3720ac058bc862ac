"""Where each millisecond goes: the spans of a picture's and of a command's way (docs/traces.md). No I/O, no clock.

Each machine measures its own spans on its own clock, so no clocks have to agree. A span that nobody has measured is
absent. The time that passes between the clocks is one remainder for each event: the whole round, as one clock has
measured it, less the spans that lie in it.
"""

import math
from collections.abc import Iterable
from typing import Annotated, Final, Literal, NamedTuple, TypeVar

import msgspec

__all__ = [
    "COMMAND_WAY",
    "MAX_SPAN_MS",
    "PICTURE_WAY",
    "CommandSpans",
    "PictureSpans",
    "Span",
    "SpanMs",
    "join_spans",
    "known_spans",
    "remainder_ms",
    "span_ms",
    "spans_at_bridge",
    "sum_of_spans",
]

MAX_SPAN_MS: Final = 600_000.0  # nothing on its way is kept for longer
SpanMs = Annotated[float, msgspec.Meta(ge=0, le=600_000)]  # ms on one clock
Absent = msgspec.UnsetType
Clock = Literal["bridge", "console", "page", "between"]  # "between": no clock's own, a remainder


class PictureSpans(msgspec.Struct, frozen=True, kw_only=True):
    """A picture's way from its capture to the canvas, in order; ms. An absent span was not measured."""

    camera_wait_ms: SpanMs | Absent = msgspec.UNSET  # bridge: from the feedback of its event to the capture
    capture_ms: SpanMs | Absent = msgspec.UNSET  # bridge: from the moment that it shows until it is whole
    bridge_encode_ms: SpanMs | Absent = msgspec.UNSET  # bridge: where the bridge encodes it
    link_wait_ms: SpanMs | Absent = msgspec.UNSET  # bridge: until the link takes it
    encoder_wait_ms: SpanMs | Absent = msgspec.UNSET  # console: from its arrival until its encoder begins
    encode_ms: SpanMs | Absent = msgspec.UNSET  # console
    packetise_ms: SpanMs | Absent = msgspec.UNSET  # console
    send_ms: SpanMs | Absent = msgspec.UNSET  # console: until its packets are encrypted and at the socket or the pacer
    assemble_ms: SpanMs | Absent = msgspec.UNSET  # page: from its last packet until it is whole and in order
    transform_ms: SpanMs | Absent = msgspec.UNSET  # page: reading its stamp
    decode_ms: SpanMs | Absent = msgspec.UNSET  # page: until the decoded picture is there
    gate_ms: SpanMs | Absent = msgspec.UNSET  # page: until the gate lets it pass
    draw_ms: SpanMs | Absent = msgspec.UNSET  # page: onto the canvas
    between_ms: SpanMs | Absent = msgspec.UNSET  # remainder of its event: networks, kernels, what nobody measures


class CommandSpans(msgspec.Struct, frozen=True, kw_only=True):
    """A command's way from the stick to the robot, and its feedback's way back, in order; ms."""

    input_ms: SpanMs | Absent = msgspec.UNSET  # page: from the change of the intention that it carries to its sending
    forward_ms: SpanMs | Absent = msgspec.UNSET  # console: from its arrival until it is on the robot link
    tick_wait_ms: SpanMs | Absent = msgspec.UNSET  # bridge: from its arrival to the next tick
    apply_ms: SpanMs | Absent = msgspec.UNSET  # bridge: limits, the robot's `apply` and `tick`
    rate_wait_ms: SpanMs | Absent = msgspec.UNSET  # bridge: while an answer would exceed the event rate
    measure_ms: SpanMs | Absent = msgspec.UNSET  # bridge: measuring the robot, until the feedback is made
    back_ms: SpanMs | Absent = msgspec.UNSET  # console: from the feedback's arrival until it is sent to the operator
    take_ms: SpanMs | Absent = msgspec.UNSET  # page: from the feedback's arrival until it is taken
    link_ms: SpanMs | Absent = msgspec.UNSET  # remainder on the console's clock: robot link, both ways
    between_ms: SpanMs | Absent = msgspec.UNSET  # remainder on the page's clock: network to the console, both ways


class Span(NamedTuple):
    """One span of a way."""

    name: str  # field of `PictureSpans` or `CommandSpans`
    clock: Clock


PICTURE_WAY: Final = (
    Span("camera_wait_ms", "bridge"),
    Span("capture_ms", "bridge"),
    Span("bridge_encode_ms", "bridge"),
    Span("link_wait_ms", "bridge"),
    Span("encoder_wait_ms", "console"),
    Span("encode_ms", "console"),
    Span("packetise_ms", "console"),
    Span("send_ms", "console"),
    Span("between_ms", "between"),
    Span("assemble_ms", "page"),
    Span("transform_ms", "page"),
    Span("decode_ms", "page"),
    Span("gate_ms", "page"),
    Span("draw_ms", "page"),
)
"""In the order in which a picture passes them; the remainder stands where most of it arises."""

COMMAND_WAY: Final = (
    Span("input_ms", "page"),
    Span("between_ms", "between"),
    Span("forward_ms", "console"),
    Span("link_ms", "between"),
    Span("tick_wait_ms", "bridge"),
    Span("apply_ms", "bridge"),
    Span("rate_wait_ms", "bridge"),
    Span("measure_ms", "bridge"),
    Span("back_ms", "console"),
    Span("take_ms", "page"),
)
"""In the order in which a command and its feedback pass them; a remainder covers both directions, and stands where the
command passes."""

Spans = TypeVar("Spans", PictureSpans, CommandSpans)


def span_ms(seconds: float) -> float:
    """Return a duration as a span: in ms, rounded to microseconds, within the bounds; 0 if it is not finite."""
    if not math.isfinite(seconds):
        return 0.0
    return round(min(max(seconds * 1000, 0.0), MAX_SPAN_MS), 3)


def known_spans(spans: PictureSpans | CommandSpans) -> dict[str, float]:
    """Return the spans that were measured, by name."""
    return {name: value for name in spans.__struct_fields__ if (value := getattr(spans, name)) is not msgspec.UNSET}


def join_spans(one: Spans, other: Spans) -> Spans:
    """Return the spans of both; where both have a span, that of `other` wins."""
    return msgspec.structs.replace(one, **known_spans(other))


def spans_at_bridge(spans: Spans) -> Spans:
    """Return only the spans that a bridge measures, without others that it may have sent."""
    way = PICTURE_WAY if isinstance(spans, PictureSpans) else COMMAND_WAY
    others = {span.name: msgspec.UNSET for span in way if span.clock != "bridge"}
    return msgspec.structs.replace(spans, **others)


def sum_of_spans(spans: PictureSpans | CommandSpans, names: Iterable[str] | None = None) -> float:
    """Return the sum of the spans with these names, in ms; an absent span counts 0. None means all names."""
    known = known_spans(spans)
    return sum(known.values()) if names is None else sum(known.get(name, 0.0) for name in names)


def remainder_ms(whole_ms: float, *parts_ms: float) -> float:
    """Return the rest of a time that one clock has measured, after the parts that lie in it are taken off.

    The rest is never negative, although the parts, measured on clocks of other rates and resolutions, may exceed the
    whole by fractions of a millisecond.
    """
    return span_ms((whole_ms - sum(parts_ms)) / 1000)
