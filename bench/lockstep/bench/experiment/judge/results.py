"""Computes the result of a run: figures of each client and stream, and the verdicts. JSON's own types. No I/O."""

from typing import Any

from lockstep.bench.experiment.choices import Choices, MediaChoice
from lockstep.bench.experiment.judge.age_gate import count_by_age
from lockstep.bench.experiment.judge.measures import beyond, event_rate, share_within, spread
from lockstep.bench.experiment.judge.playout import heard
from lockstep.bench.experiment.judge.record import ClientRecord, Rendered, Run

__all__ = ["Result", "result_of"]

Result = dict[str, Any]

COUNTS = ("received", "rendered", "discarded", "held", "violations")
RENDERED_SHARE = 0.9  # of the received pictures, with media pacing
WITHIN_SHARE = 0.99  # of the time, with media pacing
LONG_ROUND_TRIP = 0.35  # s; the two shares are promised up to here


def result_of(choices: Choices, media: MediaChoice, run: Run, round_trip: float) -> Result:
    """Return the result of a run. `round_trip`: mean of the control path, in s."""
    clients = {client.name: _client(client, run) for client in run.clients}
    return {
        "profile": choices.profile,
        "mode": choices.mode,
        "robot": choices.robot,
        "browser": choices.browser,
        "seed": choices.seed,
        "tolerance": choices.tolerance,
        "seconds": round(run.ended - run.began, 2),
        "round_trip_ms": round(round_trip * 1000, 1),
        "media": {
            "video_kbps": media.video_kbps,
            "frames_per_second": media.frames_per_second,
            "sound_codec": media.sound_codec,
            "adapts": media.adapts,
        },
        "clients": clients,
        "verdicts": _verdicts(choices, run, clients, round_trip),
        "network": run.network,
    }


def _client(client: ClientRecord, run: Run) -> Result:
    said = client.statistics
    return {
        "kind": client.kind,
        "gate": client.gate,
        "pacing": client.pacing,
        "drives": client.drives,
        "event_rate": round(event_rate(client.feedbacks), 2),
        "events": len(client.feedbacks),
        "command_to_picture_ms": _rounded(said.get("command_to_picture_ms", {})) if client.drives else None,
        "command_to_feedback_ms": _rounded(said.get("command_to_feedback_ms", {})) if client.drives else None,
        "streams": {name: _stream(client, name, run) for name in sorted(client.rendered)},
        "drawn": {"right": client.drawn_right, "wrong": client.drawn_wrong, "unreadable": client.drawn_unreadable},
        "lost": client.lost,
    }


def _stream(client: ClientRecord, name: str, run: Run) -> Result:
    before, after = (_said(statistics, name) for statistics in (client.statistics_before, client.statistics))
    counts = count_by_age(client, name, {key: after.get(key, 0) - before.get(key, 0) for key in COUNTS})
    rendered = [each for each in client.rendered[name] if each.at >= run.began]
    gaps = [abs(each.gap) for each in rendered if each.gap is not None]
    is_video = name in run.cameras
    within = share_within(client.feedbacks, client.rendered[name], client.tolerance, run.ended) if is_video else None
    return {
        "kind": "video" if is_video else "audio",
        "codec": after.get("codec", ""),
        **counts,
        "max_gap": max(gaps, default=0),
        "mean_gap": round(sum(gaps) / len(gaps), 3) if gaps else None,
        "beyond_tolerance": beyond(rendered, client.tolerance),  # the violations, counted again from outside
        "rendered_share": round(counts["rendered"] / counts["received"], 4) if counts["received"] else None,
        "within_share": None if within is None else round(within, 4),
        "age_ms": spread(each.age for each in rendered if each.age is not None),
        "thesis_player": _thesis_player(client, rendered) if not is_video else None,
    }


def _thesis_player(client: ClientRecord, rendered: list[Rendered]) -> Result | None:
    """Return the figures of the sound as the thesis' player would have played it.

    None if the client has a gate or its own player before it, or the times of capture are unknown.
    """
    if client.gate != "off" or client.kind != "headless":
        return None
    segments = [(each.at, each.stamp, each.age) for each in rendered if each.stamp is not None and each.age is not None]
    if not segments:
        return None
    found = heard(client.feedbacks, segments, client.tolerance)
    return {
        "max_gap": found.max_gap,
        "beyond_tolerance": found.beyond_tolerance,
        "thrown_away": found.thrown_away,
        "longest_delay_ms": round(found.longest_delay * 1000, 1),
    }


def _said(statistics: dict[str, Any], name: str) -> dict[str, Any]:
    """Return a stream's statistics: the headless client has a list of streams, the page has a map by name."""
    streams = statistics.get("streams", {})
    if isinstance(streams, dict):
        found: dict[str, Any] = streams.get(name, {})
        return found
    return next((stream for stream in streams if stream["stream"] == name), {})


def _rounded(percentiles: dict[str, Any]) -> Result:
    return {key: round(value, 1) if isinstance(value, float) else value for key, value in percentiles.items()}


def _verdicts(choices: Choices, run: Run, clients: dict[str, Result], round_trip: float) -> Result:
    """Return the verdicts that have to repeat with the seed. None: the run does not ask that."""
    gated = [client for client in clients.values() if client["gate"] == "event"]
    streams = [stream for client in gated for stream in client["streams"].values()]
    picture = clients[run.operator.name]["streams"].get(run.cameras[0])
    paced = choices.mode == "media" and round_trip <= LONG_ROUND_TRIP
    return {
        "no_violation": all(stream["violations"] == 0 and stream["beyond_tolerance"] == 0 for stream in streams),
        "pixels_agree": _pixels_agree([client["drawn"] for client in clients.values()]),
        "nobody_lost": not any(client["lost"] for client in clients.values()),
        "rendered_90_percent": bool(picture and (picture["rendered_share"] or 0) >= RENDERED_SHARE) if paced else None,
        "within_99_percent": bool(picture and (picture["within_share"] or 0) >= WITHIN_SHARE) if paced else None,
    }


def _pixels_agree(drawn: list[Result]) -> bool | None:
    """Return whether all read pixels agree with their stamps; None if no picture was read."""
    if any(each["wrong"] for each in drawn):
        return False
    return True if any(each["right"] for each in drawn) else None
