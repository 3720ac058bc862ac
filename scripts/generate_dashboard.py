"""Write the Grafana dashboard (deploy/grafana/dashboards/lockstep.json) from the table below.

With `--check` nothing is written and a difference ends with status 1.
"""

import json
import sys
from pathlib import Path
from typing import Any, NamedTuple

PATH = Path(__file__).resolve().parent.parent / "deploy" / "grafana" / "dashboards" / "lockstep.json"
COLUMNS = 24  # Grafana's grid


class Panel(NamedTuple):
    """One panel: its queries by legend. `unit` is a Grafana unit id."""

    title: str
    queries: dict[str, str]
    kind: str = "timeseries"
    unit: str = "short"
    width: int = 8
    height: int = 7
    mappings: dict[str, str] | None = None  # of values to words


RATE = "rate({}[$__rate_interval])"
TURNAROUND = "histogram_quantile({}, sum by (le) (rate(lockstep_robot_turnaround_seconds_bucket[$__rate_interval])))"
ROWS: dict[str, list[Panel]] = {
    "Robot and session": [
        Panel(
            "Robot link",
            {"link": "lockstep_robot_link_up"},
            "stat",
            width=4,
            height=4,
            mappings={"0": "DOWN", "1": "up"},
        ),
        Panel("Stop", {"stop": "lockstep_stopped"}, "stat", width=4, height=4, mappings={"0": "ready", "1": "STOPPED"}),
        Panel("Event", {"event": "lockstep_event"}, "stat", width=4, height=4),
        Panel("Event rate", {"events": f"{RATE.format('lockstep_feedback_total')}"}, "stat", "hertz", 4, 4),
        Panel("Peers", {"peers": "sum(lockstep_peers)"}, "stat", width=4, height=4),
        Panel(
            "Link losses, last hour",
            {"losses": "increase(lockstep_robot_link_losses_total[1h])"},
            "stat",
            "short",
            4,
            4,
        ),
    ],
    "Commands": [
        Panel("Commands by outcome", {"{{outcome}}": RATE.format("lockstep_commands_total")}, unit="hertz"),
        Panel("Refusals by reason", {"{{reason}}": RATE.format("lockstep_refusals_total")}, unit="hertz"),
        Panel(
            "Command forwarded to feedback received",
            {"median": TURNAROUND.format(0.5), "95 %": TURNAROUND.format(0.95), "99 %": TURNAROUND.format(0.99)},
            unit="s",
        ),
        Panel("Stops by where", {"{{where}}": "increase(lockstep_stops_total[5m])"}),
        Panel("Rests by why", {"{{why}}": RATE.format("lockstep_rests_total")}, unit="hertz"),
        Panel("Peers by role", {"{{role}}": "lockstep_peers"}),
    ],
    "Media": [
        Panel(
            "Frames encoded",
            {"{{stream}} {{codec}}": RATE.format("lockstep_media_frames_encoded_total")},
            unit="hertz",
        ),
        Panel(
            "Time to encode, mean",
            {
                "{{stream}} {{codec}}": "rate(lockstep_media_encode_seconds_sum[$__rate_interval]) / "
                "rate(lockstep_media_encode_seconds_count[$__rate_interval])"
            },
            unit="s",
        ),
        Panel(
            "Frames dropped by stage",
            {"{{stream}}: {{stage}}": RATE.format("lockstep_media_frames_dropped_total")},
            unit="hertz",
        ),
        Panel(
            "Sent",
            {"{{stream}}": "8 * sum by (stream) (rate(lockstep_media_bytes_sent_total[$__rate_interval]))"},
            unit="bps",
        ),
        Panel(
            "Keyframes asked for, by cause",
            {"{{stream}}: {{cause}}": RATE.format("lockstep_media_keyframe_requests_total")},
            unit="hertz",
        ),
        Panel("Peers by stream", {"{{stream}}": "lockstep_media_peers"}),
    ],
    "Health": [
        Panel(
            "Bad input by where and why",
            {"{{where}}: {{reason}}": RATE.format("lockstep_bad_input_total")},
            unit="hertz",
        ),
        Panel("Dropped by full queues", {"{{queue}}": RATE.format("lockstep_dropped_total")}, unit="hertz"),
        Panel("Own faults", {"{{where}}": "increase(lockstep_internal_errors_total[5m])"}),
        Panel("Peers gone, by why", {"{{why}}": "increase(lockstep_peers_ended_total[5m])"}),
        Panel("Processor", {"console": RATE.format("process_cpu_seconds_total")}, unit="percentunit"),
        Panel("Memory", {"console": "process_resident_memory_bytes"}, unit="bytes"),
    ],
}


def _panel(panel: Panel, number: int, column: int, line: int) -> dict[str, Any]:
    defaults: dict[str, Any] = {"unit": panel.unit}
    if panel.mappings:
        options = {value: {"text": text} for value, text in panel.mappings.items()}
        defaults["mappings"] = [{"type": "value", "options": options}]
    return {
        "id": number,
        "title": panel.title,
        "type": panel.kind,
        "datasource": {"type": "prometheus", "uid": "lockstep"},
        "gridPos": {"x": column, "y": line, "w": panel.width, "h": panel.height},
        "fieldConfig": {"defaults": defaults, "overrides": []},
        "targets": [
            {"refId": chr(ord("A") + index), "expr": query, "legendFormat": legend}
            for index, (legend, query) in enumerate(panel.queries.items())
        ],
    }


def dashboard() -> dict[str, Any]:
    """The dashboard as Grafana's JSON model."""
    panels: list[dict[str, Any]] = []
    line = 0
    for title, row in ROWS.items():
        position = {"x": 0, "y": line, "w": COLUMNS, "h": 1}
        panels.append({"id": len(panels) + 1, "type": "row", "title": title, "gridPos": position, "panels": []})
        line += 1
        column = height = 0
        for panel in row:
            if column + panel.width > COLUMNS:
                line, column, height = line + height, 0, 0
            panels.append(_panel(panel, len(panels) + 1, column, line))
            column, height = column + panel.width, max(height, panel.height)
        line += height
    return {
        "uid": "lockstep",
        "title": "Lockstep",
        "tags": ["lockstep"],
        "schemaVersion": 39,
        "editable": True,
        "refresh": "5s",
        "time": {"from": "now-15m", "to": "now"},
        "timezone": "browser",
        "panels": panels,
    }


def main(arguments: list[str]) -> int:
    text = json.dumps(dashboard(), indent=2) + "\n"
    stale = not PATH.exists() or PATH.read_text() != text
    if "--check" in arguments:
        if stale:
            print(f"{PATH.name} is not what its table says: run scripts/generate_dashboard.py", file=sys.stderr)
        return int(stale)
    PATH.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
