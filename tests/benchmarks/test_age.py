"""What a figure depends on is what its measurement runs through; comments are no change of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import age, report, stale

TREE = {
    "benchmarks/__init__.py": "",
    "benchmarks/speed.py": '''"""Speed."""
import synthesis.lazy as lazy
from benchmarks import gathered
COMMAND = ["-m", "app.start"]
def measure():
    yield gathered.solve(lazy.ask(), 3)
def served():
    return COMMAND
def draw(results):
    from synthesis.picture import picture
    picture()
''',
    "benchmarks/gathered.py": "from synthesis.solver import solve\nfrom synthesis.picture import picture\n",
    "benchmarks/service.py": "from benchmarks.speed import served\ndef measure():\n    yield served()\n",
    "synthesis/__init__.py": "",
    "synthesis/solver.py": '''"""Solves."""
LIMIT = 3
"""Steps."""
def solve(request, n: int):
    """The answer."""
    # by steps
    return step(request) if n < LIMIT else None
def step(x):
    import synthesis.deep
    return synthesis.deep.root(x)
def unused(x):
    return x
''',
    "synthesis/deep.py": "from importlib.resources import files\ndef root(x):\n    return x, files('synthesis.data')\n",
    "synthesis/data/__init__.py": "def unused():\n    return 1\n",
    "synthesis/picture.py": "def picture():\n    return 1\n",
    "synthesis/lazy.py": """from typing import TYPE_CHECKING
if TYPE_CHECKING:
    from synthesis.door import ask
def __getattr__(name):
    return name
""",
    "synthesis/door.py": "def ask():\n    return 1\ndef other():\n    return 2\n",
    "app/__init__.py": "",
    "app/start.py": 'from importlib import import_module\ndef main(scene):\n    import_module(f"app.scenes.{scene}")\n',
    "app/scenes/__init__.py": "",
    "app/scenes/lift.py": "def lift():\n    return 1\n",
}


@pytest.fixture
def tree(tmp_path) -> Path:
    for name, text in TREE.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_a_measurement_depends_on_what_it_reaches_by_names(tree) -> None:
    speed, service = (set(age.Code(tree).digests(name)) for name in ("speed", "service"))
    assert speed == {"benchmarks.speed", "synthesis.solver", "synthesis.deep", "synthesis.door"}
    assert service == {"benchmarks.service", "benchmarks.speed", "app.start", "app.scenes.lift"}


@pytest.mark.parametrize(
    ("file", "old", "new", "wanted"),
    [
        ("synthesis/solver.py", "# by steps", "# otherwise", []),
        ("synthesis/solver.py", '"""The answer."""', '"""Another."""', []),
        ("synthesis/solver.py", '"""Steps."""', '"""Most."""', []),
        ("synthesis/solver.py", "def unused(x):\n    return x", "def unused(x):\n    return 2", []),
        ("synthesis/solver.py", "return step(request) if", "return step( request ) \\\n        if", []),
        ("synthesis/picture.py", "1", "2", []),
        ("synthesis/door.py", "return 2", "return 3", []),
        ("synthesis/solver.py", "LIMIT = 3", "LIMIT = 4", ["synthesis.solver"]),
        ("synthesis/deep.py", "return x", "return -x", ["synthesis.deep"]),
        ("synthesis/data/__init__.py", "return 1", "return 2", []),
        ("synthesis/door.py", "return 1", "return 3", ["synthesis.door"]),
        ("benchmarks/speed.py", "lazy.ask(), 3", "lazy.ask(), 4", ["benchmarks.speed"]),
    ],
)
def test_a_change_is_told_where_it_is_more_than_words(tree, file, old, new, wanted) -> None:
    then = age.Code(tree).digests("speed")
    text = (tree / file).read_text()
    assert old in text
    (tree / file).write_text(text.replace(old, new))
    assert age.changed(then, age.Code(tree).digests("speed")) == wanted


def test_of_many_changed_packages_the_folder_is_named() -> None:
    then = {f"synthesis.{name}": "1" for name in "abcde"} | {"app.main": "1", "app.page": "1"}
    assert age.changed(then, {}) == ["app.main", "app.page", "synthesis"]
    assert age.folded(["app.main", "app", "tests.oracles"]) == ["app", "tests.oracles"]


def test_what_a_result_says_of_its_age(tree) -> None:
    code, stamp = age.Code(tree), {"commit": "a" * 40, "command": "python -m benchmarks.speed"}
    known = {"code": {"a" * 40: code.digests("speed")}}
    assert age.since(stamp, "speed", known, code) == []
    assert age.since(stamp, "speed", {}, code) is None
    older = {"code": {"a" * 40: {**known["code"]["a" * 40], "synthesis.deep": "-", "synthesis.gone": "-"}}}
    assert age.since(stamp, "speed", older, code) == ["synthesis.deep", "synthesis.gone"]
    assert age.since({**stamp, "commit": "a" * 40 + "+changes"}, "speed", known, code) is None
    assert age.since({**stamp, "command": "python -m benchmarks.speed --before"}, "speed", {}, code) == []
    assert age.told([["a.b", "c.d", "c.e"]]) == "before the change of `a.b`, `c.d` and `c.e`"
    assert age.told([["a.b"], [], None]).startswith("the oldest before the change of `a.b`; what has changed")
    assert age.told([[], []]) == "" and age.told([None]) == "what has changed since is not known"
    assert age.stamps({"made": stamp, "parts": [{"x": {"made": stamp}}], "code": stamp}) == [stamp, stamp]


def test_what_is_old_is_listed_with_the_time_it_took_and_run_with_today_s_options(monkeypatch) -> None:
    stamp = {"commit": "a" * 40, "command": "OMP_NUM_THREADS=1 python -m benchmarks.travel --gone 3 4 --every 2"}
    others = {"commit": "b" * 40, "command": "python -m benchmarks.travel"}
    result = {"made": stamp, "parts": {"x": {"made": others}}, "took": {others["command"]: 90}}
    monkeypatch.setattr(report, "names", lambda: ["travel"])
    monkeypatch.setattr(report, "load", lambda name: result)
    runs = stale.stale()
    assert [run.took for run in runs] == [90, None]
    assert list(stale.told(runs))[-1] == "2 to measure: 90.0 s, and 1 not timed yet"
    assert [told.rpartition("; ")[2] for told in stale.told(runs)][:2] == ["shared", "shared"]
    assert stale.words(runs[1])[1:] == ["-m", "benchmarks.travel"]
    monkeypatch.setattr(report, "commit", lambda: "a" * 40 + "+changes")
    monkeypatch.setattr(stale.subprocess, "run", lambda *_, **__: pytest.fail("measured"))
    assert stale.main([]) == 1
    assert stale.main(["--list"]) == 0
    result["code"] = {made["commit"]: report.CODE.digests("travel") for made in (stamp, others)}
    assert stale.stale() == []
