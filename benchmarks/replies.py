"""Record what a running service answers to 300 fixed requests, and compare two recordings.

::

    python -m benchmarks.replies record http://127.0.0.1:8000 before.jsonl
    python -m benchmarks.replies record http://127.0.0.1:8001 after.jsonl --like before.jsonl
    python -m benchmarks.replies compare before.jsonl after.jsonl

The requests come from the service's own description: the examples of each route, seeded variations of them, and errors.
``--like`` repeats the requests of an earlier recording, so that a change of the examples does not hide a change of a reply.
Status, content type and body are compared; times, dates and the last digits of numbers are not.
"""

from __future__ import annotations

import argparse
import base64
import http.client
import io
import json
import math
import random
import re
import sys
import zipfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlsplit

COUNT = 300
EXPORT_EXAMPLES = 2
"""Examples for a route that answers with a file; the same searches answer the route without the ending."""
RELATIVE, ABSOLUTE = 1e-9, 1e-12
TIMES = {"elapsed_ms", "load_ms"}
"""Fields of a reply that differ from run to run."""
NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)")
UNSTABLE = re.compile(
    r"\d{4}-\d\d-\d\d(?:T\d\d:\d\d:\d\d\S*)?"  # a date
    r"|\{[0-9A-F]{8}(?:-[0-9A-F]{4}){3}-[0-9A-F]{12}\}"  # an identifier that DXF draws by lot
    r"|(?<=\$TD)\w+\s+\d+\s+\S+"  # a date of DXF
    r"|(?s:(?<=CLASSES\n).*?ENDSEC)"  # a section of DXF whose entries have no order
)
"""Text that differs from run to run."""
JSON = "application/json"
TABLE = "x,y,angle\n0,0,0\n22,5,12\n41,17,27\n52,36,45\n50,58,66\n"


class SentRequest(NamedTuple):
    """A request; its name is unique in a recording."""

    name: str
    method: str
    path: str
    body: str | None = None
    kind: str | None = JSON


# -- the requests -----------------------------------------------------------------------------------------------------


def requests_of(document: dict[str, Any]) -> list[SentRequest]:
    """Return the requests for a service with this OpenAPI document."""
    posts: dict[str, dict[str, Any]] = {}
    for path, methods in document["paths"].items():
        if "post" in methods:
            prescribed = methods["post"]["requestBody"]["content"][JSON].get("examples", {})
            posts[path] = {name: example["value"] for name, example in prescribed.items()}
    questions = {path: examples for path, examples in posts.items() if "." not in path}
    found = [*_fixed(), *_examples(posts), *_errors(questions)]
    variations = _variations(questions)
    while len(found) < COUNT:
        found.append(next(variations))
    return found[:COUNT]


def _fixed() -> Iterator[SentRequest]:
    paths = ["/", "/function", "/scenes", "/scenes/lift/queries", "/static/main.js", "/docs", "/livez", "/readyz"]
    paths += ["/openapi.json"]
    for path in paths:
        for method in ("GET", "HEAD"):
            yield SentRequest(f"{method} {path}", method, path, kind=None)
    for path in ("/v2/nothing", "/static/no.js"):
        yield SentRequest(f"GET {path}", "GET", path, kind=None)
    for path in ("/livez", "/readyz", "/static/main.js"):
        yield SentRequest(f"POST {path}", "POST", path, "{}")


def _examples(posts: dict[str, dict[str, Any]]) -> Iterator[SentRequest]:
    for path, examples in posts.items():
        shown = list(examples.items())
        for name, body in shown[:EXPORT_EXAMPLES] if "." in path else shown:
            yield SentRequest(f"{path} {name}", "POST", path, json.dumps(body))


def _errors(questions: dict[str, dict[str, Any]]) -> Iterator[SentRequest]:
    wrong = {
        "malformed": ('{"rotation": [1,', JSON),
        "not a number": ('{"crank_span": NaN}', JSON),
        "infinite": ('{"crank_span": 1e999}', JSON),
        "twice": ('{"top": 1, "top": 2}', JSON),
        "a list": ("[1, 2]", JSON),
        "nothing": ("", JSON),
        "a table": (TABLE, "text/csv"),
        "no type": ("{}", None),
        "too large": ('{"name": "' + "x" * 1_100_000 + '"}', JSON),
        "deep": ("[" * 20_000, JSON),
    }
    for k, (path, examples) in enumerate(questions.items()):
        body = next(iter(examples.values()))
        yield SentRequest(f"{path} unknown field", "POST", path, json.dumps(body | {"nosuch": 1}))
        yield SentRequest(f"{path} GET", "GET", path, kind=None)
        for name in [list(wrong)[(3 * k + j) % len(wrong)] for j in range(3)]:
            content, kind = wrong[name]
            yield SentRequest(f"{path} {name}", "POST", path, content, kind)


def _variations(questions: dict[str, dict[str, Any]]) -> Iterator[SentRequest]:
    """Return bodies in which every fraction, or a single whole number, is changed slightly."""
    k = 0
    while True:
        for path, examples in questions.items():
            name, body = list(examples.items())[k % len(examples)]
            chance = random.Random(f"{path} {name} {k}")
            yield SentRequest(f"{path} {name} varied {k}", "POST", path, json.dumps(_varied(body, chance)))
        k += 1


def _varied(value: Any, chance: random.Random) -> Any:
    if isinstance(value, dict):
        return {name: _varied(part, chance) for name, part in value.items()}
    if isinstance(value, list):
        return [_varied(part, chance) for part in value]
    if isinstance(value, float):
        return round(value * (1 + 0.01 * chance.uniform(-1, 1)), 9)
    if isinstance(value, int) and not isinstance(value, bool) and value > 20 and chance.random() < 0.1:
        return value + chance.choice([-1, 1])
    return value


# -- recording --------------------------------------------------------------------------------------------------------


def record(address: str, out: Path, like: Path | None, clients: int) -> None:
    """Ask a service, and write a line of JSON for each request with its reply."""
    host = urlsplit(address).netloc
    if like is None:
        all_requests = requests_of(
            json.loads(_sent(host, SentRequest("", "GET", "/openapi.json", kind=None))["body"])
        )
    else:
        all_requests = [SentRequest(*row["asked"]) for row in _rows(like)]
    with ThreadPoolExecutor(clients) as pool, out.open("w") as file:
        for request, reply in zip(all_requests, pool.map(lambda request: _sent(host, request), all_requests)):
            file.write(json.dumps({"asked": request, **reply}) + "\n")
    print(f"wrote {out}: {len(all_requests)} replies")


def _sent(host: str, request: SentRequest) -> dict[str, Any]:
    connection = http.client.HTTPConnection(host, timeout=300)
    headers = {} if request.kind is None else {"Content-Type": request.kind}
    try:
        connection.request(
            request.method, request.path, None if request.body is None else request.body.encode(), headers
        )
        reply = connection.getresponse()
        content = reply.read()
    except (OSError, http.client.HTTPException) as error:  # refused before the whole body was sent
        return {"status": 0, "type": type(error).__name__, "body": ""}
    finally:
        connection.close()
    try:
        body = {"body": content.decode()}
    except UnicodeDecodeError:
        body = {"base64": base64.b64encode(content).decode()}
    return {"status": reply.status, "type": reply.getheader("Content-Type"), **body}


def _rows(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


# -- comparing --------------------------------------------------------------------------------------------------------


def compare(before: Path, after: Path) -> int:
    """Print each difference; return the number of requests whose replies differ."""
    later = {row["asked"][0]: row for row in _rows(after)}
    count = 0
    for row in _rows(before):
        name = row["asked"][0]
        if words := difference(row, later.get(name)):
            count += 1
            print(f"{name}: {words}")
    print(f"{count} of {len(later)} replies differ")
    return count


def difference(before: dict[str, Any], after: dict[str, Any] | None) -> str:
    """Return the first difference between two replies in words; an empty string if there is none."""
    if after is None:
        return "not asked"
    for name in ("status", "type"):
        if before[name] != after[name]:
            return f"{name} {before[name]} is now {after[name]}: {after.get('body', '')[:200]}"
    return _differ(_content(before), _content(after), "")


def _content(row: dict[str, Any]) -> Any:
    if "base64" in row:
        return _unpacked(base64.b64decode(row["base64"]))
    try:
        return json.loads(row["body"])
    except ValueError:
        return row["body"]


def _unpacked(content: bytes) -> Any:
    """Return the members of a zip file by name; other bytes as text, a character for each byte."""
    if not content.startswith(b"PK"):
        return content.decode("latin-1")
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return {name: archive.read(name).decode("latin-1") for name in archive.namelist()}


def _differ(a: Any, b: Any, path: str) -> str:
    if isinstance(a, dict) and isinstance(b, dict):
        if a.keys() != b.keys():
            return f"{path}: fields {sorted(a.keys() ^ b.keys())}"
        rows = (_differ(a[name], b[name], f"{path}/{name}") for name in a if name not in TIMES)
        return next(filter(None, rows), "")
    if isinstance(a, list) and isinstance(b, list):
        if len(a) != len(b):
            return f"{path}: {len(a)} entries are now {len(b)}"
        if path.endswith("/trace"):  # of each entry the time comes first
            a, b = [row[1:] for row in a], [row[1:] for row in b]
        rows = (_differ(x, y, f"{path}/{k}") for k, (x, y) in enumerate(zip(a, b)))
        return next(filter(None, rows), "")
    if isinstance(a, str) and isinstance(b, str):
        return "" if a == b else _differ_in_text(a, b, path)
    if isinstance(a, bool) or isinstance(b, bool) or not (_is_number(a) and _is_number(b)):
        return "" if a == b else f"{path}: {str(a)[:100]!r} is now {str(b)[:100]!r}"
    return "" if math.isclose(a, b, rel_tol=RELATIVE, abs_tol=ABSOLUTE) else f"{path}: {a} is now {b}"


def _differ_in_text(a: str, b: str, path: str) -> str:
    """Compare texts in which numbers may differ in their last digits and dates altogether."""
    a, b = UNSTABLE.sub("", a), UNSTABLE.sub("", b)
    for number, (x, y) in enumerate(zip_longest(a.splitlines(), b.splitlines()), 1):
        if x is None or y is None:
            return f"{path}: line {number} {x!r} is now {y!r}"[:300]
        if x == y:
            continue
        parts, remaining = NUMBER.split(x), NUMBER.split(y)
        same = len(parts) == len(remaining) and all(
            math.isclose(float(p), float(q), rel_tol=RELATIVE, abs_tol=ABSOLUTE) if k % 2 else p == q
            for k, (p, q) in enumerate(zip(parts, remaining))
        )
        if not same:
            return f"{path}: line {number} {x[:100]!r} is now {y[:100]!r}"
    return ""


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float))


def main() -> int:
    """Record or compare; the exit code of a comparison is 1 if replies differ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    record_parser = commands.add_parser("record", help="ask a service and write its replies")
    record_parser.add_argument("address", help="for example http://127.0.0.1:8000")
    record_parser.add_argument("out", type=Path)
    record_parser.add_argument(
        "--like", type=Path, metavar="FILE", help="repeat the requests of an earlier recording"
    )
    record_parser.add_argument("--clients", type=int, default=2, help="requests at a time (%(default)s)")
    two = commands.add_parser("compare", help="print the differences of two recordings")
    two.add_argument("before", type=Path)
    two.add_argument("after", type=Path)
    options = parser.parse_args()
    if options.command == "record":
        record(options.address, options.out, options.like, options.clients)
        return 0
    return int(compare(options.before, options.after) > 0)


if __name__ == "__main__":
    sys.exit(main())
