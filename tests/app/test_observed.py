"""What the service tells of itself: lines of JSON and figures for Prometheus."""

import json
import logging
import re
from pathlib import Path

from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families

from app import observed
from app.main import create_app
from app.settings import Settings


def test_figures_count_requests_by_route_and_status() -> None:
    with TestClient(create_app(Settings(atlas="none", metrics=True))) as client:
        for _ in range(3):
            client.post("/v1/knotter/needle", json={})
        client.post("/v1/knotter/needle", json={"x": 1})
        client.get("/nowhere/at/all")
        client.get("/nowhere/else")
        text = client.get("/metrics").text
    found = {
        (row.name, row.labels.get("route"), row.labels.get("status")): row.value
        for family in text_string_to_metric_families(text)
        for row in family.samples
    }
    count, seconds = "linkage_atlas_requests_total", "linkage_atlas_request_seconds_count"
    assert found[count, "/v1/knotter/needle", "200"] == 3 and found[count, "/v1/knotter/needle", "422"] == 1
    assert found[count, "none", "404"] == 2
    assert found[seconds, "/v1/knotter/needle", None] == 4
    assert found["linkage_atlas_waiting", None, None] == found["linkage_atlas_unread_reply_bytes", None, None] == 0
    assert found["linkage_atlas_process_memory_bytes", None, None] > 1e7


def test_the_dashboard_asks_for_figures_that_there_are() -> None:
    dashboard = (Path(__file__).parents[2] / "deploy" / "grafana.json").read_text()
    with TestClient(create_app(Settings(atlas="none", metrics=True))) as client:
        client.get("/livez")
        text = client.get("/metrics").text
    wanted = set(re.findall(r"linkage_atlas_\w+", dashboard))
    assert len(wanted) == 7
    assert all(name.removesuffix("_bucket").removesuffix("_total") in text for name in wanted)


def test_without_the_setting_there_are_none(client) -> None:
    assert client.get("/metrics").status_code == 404


def test_each_request_leaves_a_line_of_json(monkeypatch) -> None:
    rows = []

    class Handler(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            rows.append(json.loads(record.getMessage()))

    monkeypatch.setattr(observed.lines, "handlers", [Handler()])
    observed.lines.setLevel(logging.INFO)
    with TestClient(create_app(Settings(atlas="none", log_json=True))) as client:
        size = len(client.post("/v1/knotter/needle", json={}).content)
        client.get("/" + "x" * 5000)
    assert [(row["method"], row["status"]) for row in rows] == [("POST", 200), ("GET", 404)]
    assert rows[0]["path"] == "/v1/knotter/needle" and rows[0]["bytes"] == size and rows[0]["ms"] > 0
    assert len(rows[1]["path"]) == 500
