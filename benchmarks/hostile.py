"""Clients that a service has to bear: expensive requests, slow and rude connections, and bodies changed at random."""

from __future__ import annotations

import asyncio
import json
import random
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

from app.registry import all_queries
from tests.oracles.largest import CYLINDER, DESIGN, EXTRAS, TWO_RAILS, requests

PATIENCE = 90.0


def _numbers(count: int, seed: int = 1) -> list[float]:
    rng = random.Random(seed)
    return [rng.gauss(0, 1) for _ in range(count)]


def _places(count: int) -> list[list[float]]:
    return [list(pair) for pair in zip(_numbers(count, 2), _numbers(count, 3))]


def _joined(mark: str, count: int) -> str:
    return ",".join([mark] * count)


def expensive() -> dict[str, tuple[str, str]]:
    """Requests of at most 1 MB that cost as much as one can: what they are, route and body."""
    noise = {"rotation": _numbers(64), "position": _places(64), "crank_span": 300}
    dense = {"rotation": _numbers(1024), "position": _places(1024)}
    box = {"family": "any", "transmission_angle_min": 40, "pivot_box": [-1, -1, 1, 1]}
    rounded = {"round_to": 0.01, "sensitivity": True, "top": 100}
    grid = {"alpha1": [0.1 * k for k in range(100)], "alpha3": [10 + 0.1 * k for k in range(200)]}
    cylinders = [{"length": 200 + k, "speed": 100} for k in range(24)]
    nearly_still = [1e-9 * value for value in _numbers(1024)]
    largest = requests()
    bodies: dict[str, tuple[str, Any]] = {
        "samples whole turns apart": ("/v1/match", {"rotation": [0, 1, 2, 3, 4], "crank_span": 1440}),
        "far apart, top 1": ("/v1/match", {"rotation": [0, 100, -50], "crank_span": 3600, "top": 1}),
        "nearly no motion, 1,024 samples": ("/v1/match", {"rotation": nearly_still, "crank_span": 0.1, "top": 1000}),
        "1,000 rows with features": (
            "/v1/match",
            {"rotation": _numbers(1024), "crank_span": 300, "top": 1000, "features": True},
        ),
        "three positions, atlas": ("/v1/synthesize", {"position": _places(3), "crank_span": 70, "effort": "atlas"}),
        "1,024 positions within limits, atlas": (
            "/v1/synthesize",
            {"position": _places(1024), "crank_span": 300, "effort": "atlas", "top": 100, "limits": box},
        ),
        "noise within limits": ("/v1/synthesize", {**noise, "limits": box}),
        "1,024 samples of noise, 100 rounded": (
            "/v1/synthesize",
            {**dense, "crank_span": 300, **rounded, "limits": {"family": "any", "transmission_angle_min": 20}},
        ),
        "1,024 poses without crank angles": (
            "/v1/synthesize",
            {**dense, "timing": "free", "order": "any", "closed": True, **rounded},
        ),
        "path of 1,024 points": ("/v1/synthesize", {"position": _places(1024), "timing": "free", "top": 100}),
        "lift: 100,000 samples, everything": (
            "/v1/lift/motion",
            {"design": DESIGN, "cylinder": CYLINDER, "samples": 100_000, "include": EXTRAS},
        ),
        "lift: 24 cylinders": (
            "/v1/lift/batch",
            {"cylinders": cylinders, "stroke": [200, 510], "objective": {"kind": "discrete", "n": 500}},
        ),
        "knotter: 20,000 combinations": ("/v1/knotter/scan", {"grid": grid}),
        "chain: 10,001 samples, 4,096 knots": (
            "/v1/chain/slot",
            {
                "pitch": 131,
                "links": 16,
                "upper_radius": 181.78,
                "samples": 10_001,
                "fit": {"kind": "spline", "order": 4096},
            },
        ),
        **{
            name: (largest[name].path, largest[name].body)
            for name in (
                "sliders: poses, everything reported",
                "sliders: travel within all limits",
                "assembly: a star between thin links",
                "drives: four times two of 200 springs",
            )
        },
        "90,000 unknown keys": ("/v1/match", "{" + ",".join(f'"k{k}":1' for k in range(90_000)) + "}"),
        "2,000 unknown keys": ("/v1/match", "{" + ",".join(f'"k{k}":1' for k in range(2_000)) + "}"),
        "330,000 empty lists": ("/v1/synthesize", '{"position":[' + _joined("[]", 330_000) + "]}"),
        "110,000 wrong values": ("/v1/lift/motion", '{"times":[' + _joined('""', 110_000) + "]}"),
        "nested 400,000 deep": ("/v1/match", '{"rotation":' + "[" * 400_000 + "}"),
    }
    return {
        name: (path, body if isinstance(body, str) else json.dumps(body)) for name, (path, body) in bodies.items()
    }


SHORT = {
    "livez": ("/livez", None),
    "type": ("/v1/types/45185", None),
    "needle": ("/v1/knotter/needle", "{}"),
    "match": ("/v1/match", {"rotation": [22.5, 20.2, 17.8, 15.3, 12.9, 10.5, 8.2, 6.2], "crank_span": 70, "top": 2}),
    "lift": ("/v1/lift/motion", {"design": DESIGN, "cylinder": CYLINDER, "samples": 21}),
}
"""What well-meant clients ask."""


@dataclass
class Seen:
    """What clients of one kind saw."""

    seconds: list[float] = field(default_factory=list)
    status: Counter[str] = field(default_factory=Counter)


async def ask(port: int, path: str, body: Any = None, half_closed: bool = False) -> int:
    """Status of one request on a connection of its own; 0 where there was no answer."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        content = b"" if body is None else (body if isinstance(body, str) else json.dumps(body)).encode()
        lines = [f"{'GET' if body is None else 'POST'} {path} HTTP/1.1", "Host: 127.0.0.1", "Connection: close"]
        if body is not None:
            lines += ["Content-Type: application/json", f"Content-Length: {len(content)}"]
        writer.write("\r\n".join([*lines, "", ""]).encode() + content)
        if half_closed:
            writer.write_eof()
        while (line := await asyncio.wait_for(reader.readline(), PATIENCE)).startswith(b"HTTP/1.1 100"):
            await reader.readline()
        while await asyncio.wait_for(reader.read(1 << 16), PATIENCE):
            pass
        return int(line.split()[1]) if line else 0
    except (OSError, TimeoutError):
        return 0
    finally:
        writer.close()


async def repeat(
    until: float, seen: Seen, work: Callable[[], Awaitable[int]], pause: float = 0.0, after: float = 0.0
) -> None:
    """Ask again and again, first after some seconds."""
    await asyncio.sleep(after)
    while time.perf_counter() < until:
        begin = time.perf_counter()
        try:
            status = await work()
        except OSError:
            status = 0
        seen.seconds.append(time.perf_counter() - begin)
        seen.status[str(status)] += 1
        await asyncio.sleep(pause)


async def hold(port: int, said: bytes, count: int, until: float, reads: bool = True) -> int:
    """Connections that say something and no more, opened again when they are closed; how many were.

    One that does not read is opened again after `UNREAD_SECONDS`.
    """
    opened = 0

    async def one() -> None:
        nonlocal opened
        while time.perf_counter() < until:
            try:
                reader, writer = await asyncio.open_connection("127.0.0.1", port)
                opened += 1
                writer.write(said)
                left = max(0.01, until - time.perf_counter())
                await (asyncio.wait_for(reader.read(), left) if reads else asyncio.sleep(min(left, UNREAD_SECONDS)))
                writer.close()
            except (OSError, TimeoutError):
                await asyncio.sleep(0.05)

    await asyncio.gather(*(one() for _ in range(count)))
    return opened


async def leave(port: int, path: str, body: Any) -> int:
    """Ask, and close the connection in the ordinary way without waiting for the answer."""
    content = json.dumps(body).encode()
    _, writer = await asyncio.open_connection("127.0.0.1", port)
    head = (
        f"POST {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\nContent-Length: {len(content)}"
    )
    writer.write(f"{head}\r\n\r\n".encode() + content)
    writer.close()
    return 0


HEAD = (
    b"POST /v1/match HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\nContent-Length: 900000\r\n\r\n"
)
_LIFT = json.dumps({"design": DESIGN, "cylinder": CYLINDER, "samples": 20_000}).encode()
LARGE = (
    b"POST /v1/lift/motion HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\nContent-Length: %d\r\n\r\n%s"
    % (len(_LIFT), _LIFT)
)
"""A request whose reply has some megabytes."""
SLOW = {
    "says nothing": (b"", 200, True),
    "unfinished header": (HEAD[:-2], 50, True),
    "unfinished body": (HEAD + b"[" * 400_000, 50, True),
    "no HTTP": (b"\x16\x03\x01\x02 hello\r\n\r\n", 2, True),
    "many replies unread": (b"GET /openapi.json HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n" * 50, 100, False),
    "large replies unread": (LARGE, 20, False),
}
"""What slow and rude clients say, how many connections they hold, and whether they read what is answered."""
UNREAD_SECONDS = 8.0


def mutated(seed: int) -> Iterator[tuple[str, bytes]]:
    """Route and body, without end: examples of all routes with a change, sometimes several, in value, shape or bytes."""
    rng = random.Random(seed)
    examples = [(query.path, json.dumps(body)) for query in all_queries() for body in query.examples.values()]
    examples += [
        (f"{query.path}.{name}", next(iter(query.examples.values())))
        for query in all_queries()
        for name in query.exports
    ]
    examples += [
        (query.files.path, {**query.files.example, "format": kind})
        for query in all_queries()
        if query.files is not None
        for kind in query.files.formats
    ]
    examples += _of_sliders()
    strange: list[Any] = [
        None,
        True,
        -1,
        0,
        1e308,
        -1e-308,
        10**40,
        "",
        "\ud800",
        "x" * 5000,
        [],
        {},
        [[]],
        {"a": 1},
        [None] * 50,
    ]
    while True:
        path, text = rng.choice(examples)
        values = json.loads(text) if isinstance(text, str) else json.loads(json.dumps(text))
        values.setdefault("budget_ms", 5) if path.startswith(("/v1/synthesize", "/v1/match")) else None
        for _ in range(rng.choice([0, 1, 1, 1, 2, 5])):
            _change(values, rng, strange)
        content = json.dumps(values).encode("utf-8", "replace")
        if rng.random() < 0.3:
            content = _scrambled(bytearray(content), rng)
        yield path, content


def _of_sliders() -> list[tuple[str, dict[str, Any]]]:
    """Requests for linkages with sliders, with everything that can be asked of one, and what is asked of one that is given."""
    poses = {"rotation": [0, 20, 45], "position": [[0, 0], [30, 10], [60, 35]], "mechanisms": "all"}
    asked = {
        "assembly": {"body": [[0, 0], [20, 0], [0, 20]], "boards": "both"},
        "load": {"force": [3, -10], "masses": [{"link": "body", "mass": 1}]},
        "drives": [{"kind": "actuator"}, {"kind": "dyad"}],
        "springs": [{"kind": "tension", "catalogue": "tension_springs"}],
        "tolerance_study": {"links": 0.1, "pivots": 0.1, "clearance": 0.05},
        "round_to": 1,
    }
    given = {"request": {**poses, "timing": "free"}, "assembly": {"body": [[0, 0], [20, 0], [0, 20]]}}
    functions = {"output": [0, 5, 12, 21, 32], "crank_span": 60, "output_unit": "length"}
    return [
        ("/v1/synthesize", {**poses, **asked, "timing": "free"}),
        ("/v1/synthesize", {**poses, **asked, "travel": [0, 20, 50], "driver": "slider"}),
        ("/v1/function", {**functions, "budget_ms": 5}),
        ("/v1/assembly", {"linkage": TWO_RAILS, **given["assembly"], "request": given["request"]}),
        ("/v1/drives", {"linkage": TWO_RAILS, **{name: asked[name] for name in ("load", "drives", "springs")}}),
        *(
            ("/v1/export", {**given, "solution": TWO_RAILS, "format": kind})
            for kind in ("csv", "svg", "dxf", "mjcf", "step")
        ),
    ]


def _change(values: Any, rng: random.Random, strange: list[Any]) -> None:
    """One value somewhere within replaced, removed, repeated or added to."""
    while isinstance(values, (dict, list)) and values:
        places = list(values) if isinstance(values, dict) else range(len(values))
        place = rng.choice(list(places))
        if not isinstance(values[place], (dict, list)) or rng.random() < 0.3:
            break
        values = values[place]
    if not isinstance(values, (dict, list)) or not values:
        return
    kind = rng.random()
    if kind < 0.6:
        values[place] = deepcopy(rng.choice(strange))
    elif kind < 0.8:
        del values[place]
    elif isinstance(values, list):
        values.extend(deepcopy(values[:200]))
    else:
        values[rng.choice(["x", "top", "rotation", "limits"])] = deepcopy(rng.choice(strange))


def _scrambled(content: bytearray, rng: random.Random) -> bytes:
    for _ in range(rng.choice([1, 1, 3, 20])):
        if content:
            content[rng.randrange(len(content))] = rng.randrange(256)
    if rng.random() < 0.3:
        del content[rng.randrange(len(content) + 1) :]
    return bytes(content)
