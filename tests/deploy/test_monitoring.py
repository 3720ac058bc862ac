"""What Prometheus and Grafana are told, against the measurements that the console really shows."""

import re
import subprocess
from pathlib import Path

import pytest
from prometheus_client import generate_latest
from prometheus_client.parser import text_string_to_metric_families

from lockstep.server.federation.metrics import BoardMetrics
from lockstep.server.media.metrics import MediaMetrics
from lockstep.server.telemetry.metrics import Metrics
from scripts.generate_dashboard import PATH as DASHBOARD
from scripts.generate_dashboard import dashboard, main

ROOT = Path(__file__).resolve().parents[2]
PROMETHEUS = ROOT / "deploy" / "prometheus"


def _known() -> set[str]:
    """Every series that /metrics can hold. A counter without labels set yet is listed by its family."""
    metrics = Metrics()
    MediaMetrics(metrics.registry)
    BoardMetrics(metrics.registry)
    names: set[str] = set()
    for family in text_string_to_metric_families(generate_latest(metrics.registry).decode()):
        suffixes = {"counter": ["_total"], "histogram": ["_bucket", "_sum", "_count"]}.get(family.type, [""])
        names |= {family.name + suffix for suffix in suffixes}
    return names


def _used(text: str) -> set[str]:
    return set(re.findall(r"\b(?:lockstep|process)_[a-z_]+", text))


def test_every_panel_draws_a_measurement_that_exists() -> None:
    queries = " ".join(target["expr"] for panel in dashboard()["panels"] for target in panel.get("targets", []))
    assert len(_used(queries)) > 15
    assert _used(queries) - _known() == set()


def test_every_alert_watches_a_measurement_that_exists() -> None:
    used = _used((PROMETHEUS / "alerts.yml").read_text())
    assert used
    assert used - _known() == set()


def test_what_keeps_everybody_out_or_loses_what_is_kept_has_an_alert() -> None:
    watched = _used((PROMETHEUS / "alerts.yml").read_text())
    assert {
        "lockstep_audit_failing",
        "lockstep_board_up",
        "lockstep_links_unreadable",
        "lockstep_recording_failed",
        "lockstep_recording_free_bytes",
        "lockstep_tls_certificate_end_seconds",
    } <= watched


def test_prometheus_accepts_its_configuration_and_the_rules() -> None:
    command = ["promtool", "check", "config", str(PROMETHEUS / "prometheus.yml")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


def test_the_dashboard_file_is_what_its_table_says() -> None:
    assert main(["--check"]) == 0


def test_a_stale_dashboard_file_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    copy = tmp_path / "lockstep.json"
    copy.write_text(DASHBOARD.read_text().replace("Event rate", "Rate"))
    monkeypatch.setattr("scripts.generate_dashboard.PATH", copy)
    assert main(["--check"]) == 1


def test_panels_do_not_overlap() -> None:
    taken: set[tuple[int, int]] = set()
    for panel in dashboard()["panels"]:
        place = panel["gridPos"]
        cells = {(place["x"] + x, place["y"] + y) for x in range(place["w"]) for y in range(place["h"])}
        assert not cells & taken, panel["title"]
        assert max(x for x, _ in cells) < 24
        taken |= cells
