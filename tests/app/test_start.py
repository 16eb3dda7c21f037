"""What a start imports: what the service is ready without comes later, and is there when it is asked for."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from app import cli
from app.computed import Questions
from app.main import create_app
from app.registry import all_queries, function_queries, motion_queries, worked_example
from app.scenes import SCENES, queries_of
from app.settings import Settings

ROOT = Path(__file__).parents[2]
LATER = {
    "fastapi": "for the description alone",
    "h5py": "for an atlas that has no index yet",
    "scipy": "for splines",
    "ezdxf": "for exports",
    "linkage_atlas.door": "for searches",
    "synthesis.search.search": "for searches",
    "synthesis.free.search": "for searches",
    "app.fourbar.function": "for functions",
    "app.scenes.lift": "for a scene",
    "app.scenes.chain": "for a scene",
    "app.scenes.knotter": "for a scene",
}
"""What a service with an index is ready without, and what it is for."""
READY = """
import json, sys
from app import cli, supervisor

def ready(self):
    self._resources.prepare()
    at_ready = set(sys.modules)
    question = self._questions["/v1/match"]
    body = question.model.model_validate(json.loads(sys.argv[2]))
    assert question.answer(body, self._resources).status_code == 200
    matched = set(sys.modules)
    for step in self._steps:
        assert step()
    print(json.dumps([sorted(at_ready), sorted(matched), sorted(sys.modules), sorted(self._questions)]))
    return 0

supervisor.Supervisor.run = ready
raise SystemExit(cli.main(["serve", "--port", "0", "--atlas", sys.argv[1]]))
"""
"""The command up to where the supervisor begins, then a match, then what the supervisor prepares behind the first answers."""


@pytest.fixture(scope="module")
def started(small_bytes, tmp_path_factory) -> list[set[str]]:
    """Modules of the supervisor when it begins, after a match and at last; and the paths of its questions."""
    atlas = tmp_path_factory.mktemp("start") / "small.h5"
    atlas.write_bytes(small_bytes)
    assert cli.main(["index", "--atlas", str(atlas)]) == 0
    example = worked_example()
    body = json.dumps({"rotation": example["rotation"], "crank_span": example["crank_span"]})
    command = [sys.executable, "-c", READY, str(atlas), body]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return [set(names) for names in json.loads(done.stdout.splitlines()[-1])]


def test_what_the_service_is_ready_without_is_not_imported_before(started) -> None:
    at_ready = started[0]
    assert not at_ready & LATER.keys()
    assert "app.fourbar.models" in at_ready and "synthesis.atlas.scan" in at_ready


def test_a_match_imports_nothing(started) -> None:
    at_ready, matched = started[:2]
    assert not matched - at_ready


def test_searches_and_all_questions_are_there_once_the_supervisor_has_prepared_them(started) -> None:
    *_, later, paths = started
    missing = LATER.keys() - later
    assert missing <= {"fastapi", "h5py", "scipy", "ezdxf"}
    assert {query.path for query in all_queries()} <= paths


def test_questions_that_come_later_have_paths_by_which_they_are_known() -> None:
    for scene in SCENES:
        assert all(query.path.startswith(f"/v1/{scene}/") for query in queries_of(scene))
    assert all(query.path.startswith("/v1/function") for query in function_queries())
    assert not any(query.path.startswith("/v1/function") for query in motion_queries())


def test_a_question_comes_with_the_first_of_its_kind() -> None:
    questions = create_app(Settings(atlas=Path("none"), with_atlas=False)).state.questions
    assert "/v1/match" in questions and "/v1/lift/motion" not in questions and "/v1/chain/slot" not in questions
    assert questions["/v1/lift/motion"].path == "/v1/lift/motion"
    assert "/v1/lift/optimize" in questions and "/v1/chain/slot" not in questions
    with pytest.raises(KeyError):
        questions["/v1/lift/nothing"]
    with pytest.raises(KeyError):
        questions["/v1/nothing"]
    questions.load()
    assert {query.path for query in all_queries()} <= set(questions)


def test_questions_are_added_once_however_many_ask_at_the_same_time() -> None:
    questions, added, begun = Questions(), [], threading.Barrier(8)
    question: Any = object()

    def add() -> None:
        added.append(threading.get_ident())
        threading.Event().wait(0.05)
        questions["/v1/late/one"] = question

    questions.later("/v1/late/", add)
    found = []

    def ask() -> None:
        begun.wait()
        found.append(questions["/v1/late/one"])

    threads = [threading.Thread(target=ask) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [question] * 8 and len(added) == 1


HEAVY = ["fastapi", "starlette", "uvicorn", "pydantic", "scipy", "h5py", "numpy", "pywt", "ezdxf", "shtab", "tqdm"]


@pytest.mark.parametrize(
    ("arguments", "without"),
    [
        ("--help", HEAVY),
        ("--version", HEAVY),
        (
            "lift --help",
            ["pydantic_settings", "starlette", "scipy", "h5py", "pywt", "ezdxf", "shtab", "tqdm"],
        ),
        (
            "synthesize --example worked_example",
            ["fastapi", "starlette", "uvicorn", "scipy", "h5py", "ezdxf", "shtab", "tqdm", "app.scenes.lift"],
        ),
    ],
)
def test_a_command_imports_nothing_that_it_does_not_need(arguments, without) -> None:
    code = f"""
import sys
from app import start
try:
    start.main()
except SystemExit:
    pass
sys.exit(" ".join(name for name in {without} if name in sys.modules) or 0)
"""
    done = subprocess.run([sys.executable, "-c", code, *arguments.split()], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", ["serve", "index", "synthesize", "study", "example", "lift", "completion"])
def test_a_command_that_is_named_alone_takes_what_it_takes_among_all(name, capsys) -> None:
    arguments = {
        "serve": ["--port", "7", "--no-index", "--workers", "3"],
        "index": ["--atlas", "a"],
        "synthesize": ["--rank", "3", "--set", "top=3"],
        "study": ["lines", "--out", "replies"],
        "lift": ["motion"],
        "completion": ["zsh"],
    }
    alone, among = cli.make_parser(named=name), cli.make_parser(whole=True)
    made = [vars(parser.parse_args([name, *arguments.get(name, [])])) for parser in (alone, among)]
    for values in made:
        del values["run"]
    assert made[0] == made[1]
    texts = []
    for parser in (alone, among):
        with pytest.raises(SystemExit):
            parser.parse_args([name, "--help"])
        texts.append(capsys.readouterr().out)
    assert texts[0] == texts[1] and f"linkage-atlas {name}" in texts[0]
