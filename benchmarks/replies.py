"""``python -m benchmarks.replies FILE``: record some 500 replies of the service, or, where the file is there, compare with them.

For changes that must change no reply. Time is counted in looks at the clock, so that a search ends at the same place on any
machine; of every request the status, the headers that describe the body, and the body are kept, numbers compared to 1e-9.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from starlette.testclient import TestClient

from app.main import create_app
from app.registry import all_queries, worked_example
from app.settings import Settings
from synthesis.work import Work
from tests.everyday import battery

LOOK = 1e-3
"""Seconds that pass from one look at the clock to the next."""
BUDGET_MS = 150
CLOSE = 1e-9
VOLATILE = {"elapsed_ms", "trace", "load_ms", "scan_bytes", "evaluated"}
"""Names of what is of time, or says how much was looked at and not what was found."""
WRONG: dict[str, Any] = {
    "empty": {},
    "list": [],
    "number": 3,
    "unknown": {"unknwon": 1},
    "null": {"rotation": None, "top": None},
    "text": {"rotation": "steep", "position": "here", "top": "many", "theta": "x", "budget_ms": "soon"},
    "negative": {"top": -1, "budget_ms": -5, "limits": {"link_min": -3}},
    "deep": {"limits": {"links": {"crank": [1]}, "pivot_box": [1, 2, 3]}, "analysis": {"load": 4}},
}


class Asked(NamedTuple):
    """One request."""

    name: str
    method: str
    path: str
    body: Any = None


def requests() -> Iterator[Asked]:
    """What is asked: examples and their files, wrong bodies, matches, everyday questions within limits."""
    for path in ("/v1/atlas", "/v1/types/45185", "/v1/types/0", "/openapi.json", "/livez", "/nowhere"):
        yield Asked(path, "GET", path)
    for query in all_queries():
        for name, body in query.examples.items():
            yield Asked(f"{query.path} {name}", "POST", query.path, body)
            for format in query.exports:
                yield Asked(f"{query.path}.{format} {name}", "POST", f"{query.path}.{format}", body)
        whole = next(iter(query.examples.values()))
        for name, body in WRONG.items():
            yield Asked(f"{query.path} wrong {name}", "POST", query.path, body)
            if isinstance(body, dict):
                yield Asked(f"{query.path} wrong {name} beside", "POST", query.path, whole | body)
    yield from _matches()
    for k, row in enumerate(battery.rows()):
        body = battery.limited(row, battery.KINDS[k % len(battery.KINDS)]) | {"budget_ms": BUDGET_MS}
        if row.route == "synthesize":
            body |= ({}, {"prefer": "size"}, {"sensitivity": True, "diverse": True})[k % 3]
        yield Asked(f"everyday {row.name}", "POST", f"/v1/{row.route}", body)


def _matches() -> Iterator[Asked]:
    example = worked_example()
    for span in (1.0, 5.0, 20.0, 70.0, 200.0, 360.0):
        for curve in ("coupler", "rocker"):
            turned = [span * (k / 15 + 0.1 * math.sin(k)) for k in range(16)]
            for more in ({}, {"features": True, "top": 30}):
                body = {"rotation": turned, "crank_span": span, "curve": curve, **more}
                yield Asked(f"match {span} {curve} {len(more)}", "POST", "/v1/match", body)
        body = example | {"effort": "atlas", "crank_span": span}
        yield Asked(f"atlas {span}", "POST", "/v1/synthesize", body)
        yield Asked(f"atlas any {span}", "POST", "/v1/synthesize", body | {"limits": {"family": "crank_rocker"}})
        del body["rotation"]
        yield Asked(f"atlas positions {span}", "POST", "/v1/synthesize", body)


class Looks:
    """A clock that passes `LOOK` at each look of a `Work` at its budget."""

    def __init__(self) -> None:
        self.count = 0
        expired, begun = Work.expired, Work.__init__

        def look(work: Work) -> bool:
            self.count += 1
            return expired(work)

        def begin(work: Work, budget: float | None = None, cancelled: Any = None, clock: Any = None) -> None:
            begun(work, budget, cancelled, lambda: LOOK * self.count)

        Work.expired, Work.__init__ = look, begin  # type: ignore[method-assign]


def answers(atlas: Path, only: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Each request's name and what came back."""
    Looks()
    with TestClient(create_app(Settings(atlas=atlas, index=False, prepare_positions=False))) as client:
        for asked in requests():
            if only not in asked.name:
                continue
            reply = client.request(asked.method, asked.path, json=asked.body if asked.method == "POST" else None)
            media = reply.headers.get("content-type", "")
            body = reply.json() if "json" in media else _undated(reply.text)
            yield asked.name, {"status": reply.status_code, "media": media, "body": body}


def _undated(text: str) -> str:
    """A file, of a DXF its entities: its head says when it was written."""
    return text.split("ENTITIES\n")[-1].split("ENDSEC")[0] if text.startswith("  0\nSECTION") else text


def differences(was: Any, now: Any, place: str = "") -> Iterator[str]:
    """Where two replies differ, of each list or object the first few places."""
    if isinstance(was, dict) and isinstance(now, dict):
        for name in [*was, *(name for name in now if name not in was)]:
            if name in VOLATILE:
                continue
            if name not in was or name not in now:
                yield f"{place}/{name}: only {'before' if name in was else 'now'}"
            else:
                yield from differences(was[name], now[name], f"{place}/{name}")
    elif isinstance(was, list) and isinstance(now, list) and len(was) == len(now):
        for k, (one, other) in enumerate(zip(was, now)):
            yield from differences(one, other, f"{place}/{k}")
    elif isinstance(was, float | int) and isinstance(now, float | int) and not isinstance(was, bool):
        if not abs(was - now) <= CLOSE * max(1.0, abs(was), abs(now)):
            yield f"{place}: {was!r}, now {now!r}"
    elif was != now:
        yield f"{place}: {str(was)[:120]!r}, now {str(now)[:120]!r}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path, help="lines of JSON, a reply each")
    parser.add_argument("--atlas", type=Path, required=True)
    parser.add_argument("--only", default="", help="compare only requests whose names contain this")
    options = parser.parse_args()
    if not options.file.exists():
        with options.file.open("w") as file:
            for name, reply in answers(options.atlas):
                file.write(json.dumps([name, reply]) + "\n")
        return
    before = {name: reply for name, reply in map(json.loads, options.file.open()) if options.only in name}
    changed = 0
    for name, reply in answers(options.atlas, options.only):
        found = list(differences(before.pop(name, None), json.loads(json.dumps(reply))))
        changed += bool(found)
        for row in found[:5]:
            print(f"{name}: {row}")
    print(f"{changed} replies changed, {len(before)} no longer asked for")
    sys.exit(bool(changed or before))


if __name__ == "__main__":
    main()
