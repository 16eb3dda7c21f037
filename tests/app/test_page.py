"""The page's files have a strict policy, are cached and complete, and load nothing from elsewhere.

A reference to another host, a module that no page loads, or a changed vendored file would show here.
"""

import hashlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

from app.scenes import SCENES
from linkage_atlas.notes import LIMIT_WORDS
from tests.vectors.make_guided import FILE as GUIDED
from tests.vectors.make_guided import vectors as guided_vectors
from tests.vectors.make_kinematics import FILE as VECTORS
from tests.vectors.make_kinematics import vectors

ROOT = Path(__file__).parents[2]
STATIC = ROOT / "app/static"
MEDIA_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".svg": "image/svg+xml",
}
FILES = sorted(path for path in STATIC.rglob("*") if path.suffix in MEDIA_TYPES)


def test_root_is_the_page_with_a_strict_policy(client) -> None:
    reply = client.get("/")
    assert reply.status_code == 200 and reply.headers["content-type"] == "text/html; charset=utf-8"
    policy = dict(part.strip().split(" ", 1) for part in reply.headers["content-security-policy"].split(";"))
    assert policy["default-src"] == "'none'" and policy["frame-ancestors"] == "'none'"
    assert all(value in ("'self'", "'none'") for value in policy.values()), "no unsafe-inline, no host, no data:"
    assert reply.headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(STATIC).as_posix())
def test_every_file_is_served_as_it_is_and_known_again(client, path) -> None:
    name = path.relative_to(STATIC).as_posix()
    pages = {"index.html": "/", "scene.html": f"/scenes/{next(iter(SCENES))}"}
    address = pages.get(name, f"/static/{name}")
    reply = client.get(address)
    assert reply.status_code == 200 and reply.content == path.read_bytes()
    assert reply.headers["content-type"] == MEDIA_TYPES[path.suffix]
    assert "content-security-policy" in reply.headers
    repeated = client.get(address, headers={"if-none-match": f'"other", W/{reply.headers["etag"]}'})
    assert repeated.status_code == 304 and not repeated.content
    assert client.get(address, headers={"if-none-match": '"other"'}).status_code == 200
    assert client.get(address).headers.get("content-encoding") in ("gzip", None)
    plain = client.get(address, headers={"accept-encoding": "identity"})
    assert "content-encoding" not in plain.headers and plain.content == path.read_bytes()
    head = client.head(address)
    assert head.status_code == 200 and not head.content


OUTSIDE = ["../page.py", "%2e%2e/page.py", "..%2fpage.py", "..%5cpage.py", "/etc/passwd", "%00", ""]
OF_NO_PAGE = ["vendor", "x.js"]
NOWHERE = [f"/static/{name}" for name in OUTSIDE + OF_NO_PAGE]


@pytest.mark.parametrize("address", [*NOWHERE, *map("/scenes/".__add__, ("no_such", "no_such/queries", "%2e%2e"))])
def test_nothing_else_is_reached(client, address) -> None:
    reply = client.get(address)
    assert reply.status_code == 404
    assert reply.headers["content-type"] == "application/problem+json"


def test_every_file_belongs_to_a_page() -> None:
    """Files that a script requests, such as the examples, are included."""
    used = set().union(*(loads(path.name) for path in STATIC.glob("*.html")))
    assert used == {path.relative_to(STATIC).as_posix() for path in FILES}


def loads(name: str) -> set[str]:
    """A page's file and all that it refers to, directly or through its modules."""
    found, waiting = set(), [name]
    while waiting:
        path = waiting.pop()
        found.add(path)
        text = (STATIC / path).read_text() if "vendor" not in path and not path.endswith(".svg") else ""
        named = re.findall(r'"/static/([^"]+)"', text) + re.findall(r'from "\./([^"]+)"', text)
        waiting += [second for second in named if second not in found]
    return found


def test_there_is_no_reference_to_elsewhere() -> None:
    for path in FILES:
        if "vendor" in path.parts:
            continue
        text = path.read_text().replace("http://www.w3.org/2000/svg", "")
        assert not re.search(r"https?:|//[a-z0-9-]+\.[a-z]{2,}/|wss?:|data:", text), path
        if path.suffix == ".html":
            assert "<style" not in text and " style=" not in text and not re.search(r"<script(?![^>]* src=)", text)
            assert not re.search(r"\son[a-z]+=", text)


@pytest.mark.parametrize("folder", ["app/static/vendor", "tests/vendor", "app/docs"])
def test_vendored_files_are_those_that_are_named(folder) -> None:
    folder = ROOT / folder
    named = dict(re.findall(r"\| (\S+) \| ([0-9a-f]{64}) \|", (folder / "README.md").read_text()))
    assert named
    for name, digest in named.items():
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest
    remaining = {"README.md", "uPlot.LICENSE", "axe-core.LICENSE"}
    if folder.name == "docs":
        remaining = {"README.md", "swagger-ui.LICENSE", "index.html", "docs.js"}
    assert {p.name for p in folder.iterdir()} - set(named) <= remaining


def test_scene_pages_say_what_their_forms_are_made_from(client) -> None:
    assert [scene["name"] for scene in client.get("/scenes").json()] == list(SCENES)
    for name in SCENES:
        details = client.get(f"/scenes/{name}/queries").json()
        for query in details["queries"]:
            assert query["schema"]["type"] == "object" and query["examples"]
            assert query["path"].startswith(f"/v2/{name}/")
        assert client.get(f"/scenes/{name}").status_code == 200


def test_vectors_are_made_by_their_script() -> None:
    stored, built = json.loads(VECTORS.read_text()), vectors()
    assert len(stored) == len(built)
    for element, two in zip(stored, built):
        words = [
            {name: value for name, value in row.items() if not isinstance(value, float)} for row in (element, two)
        ]
        assert words[0] == words[1]
        for name in ("coupler", "rocker", "transmission", "crank_angle"):
            assert np.isclose(element.get(name, 0), two.get(name, 0), rtol=0, atol=1e-12)


def test_vectors_of_rails_and_slots_are_made_by_their_script() -> None:
    stored, built = json.loads(GUIDED.read_text()), guided_vectors()
    assert len(stored) == len(built)
    for element, two in zip(stored, built):
        assert element["closed"] == two["closed"] and element["solution"].keys() == two["solution"].keys()
        for name in ("rotation", "transmission", "travel", "place"):
            assert np.allclose(element.get(name, 0), two.get(name, 0), rtol=1e-12, atol=1e-12)


def test_the_page_calls_limits_as_notes_do() -> None:
    block = re.search(r"const LABELS = \{(.*?)\};", (STATIC / "verdict.js").read_text(), re.DOTALL)[1]
    labels = dict(re.findall(r'(\w+): "([^"]+)"', block))
    assert labels.items() >= {name: words[0] for name, words in LIMIT_WORDS.items()}.items()
