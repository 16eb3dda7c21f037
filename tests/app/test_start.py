"""What a start imports: what the service is ready without comes later, and is there when it is asked for."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from app import cli
from app.registry import all_queries, worked_example
from tests.conftest import PATIENCE

ROOT = Path(__file__).parents[2]
LATER = {"ezdxf": "for exports"}
"""Libraries that a service does not import before it is ready, and their use."""
READY = """
import json, sys
from app import cli, supervisor

def ready(self):
    self._resources.load()
    at_ready = set(sys.modules)
    question = self._questions["/v1/match"]
    body = question.model.model_validate(json.loads(sys.argv[2]))
    assert question.answer(body, self._resources).status_code == 200
    print(json.dumps([sorted(at_ready), sorted(sys.modules), sorted(self._questions)]))
    return 0

supervisor.Supervisor.run = ready
raise SystemExit(cli.main(["serve", "--port", "0", "--atlas", sys.argv[1]]))
"""
"""The command up to where the supervisor begins, then a match."""


def test_a_service_has_all_questions_at_once_and_a_match_imports_nothing(small_bytes, tmp_path) -> None:
    atlas = tmp_path / "small.h5"
    atlas.write_bytes(small_bytes)
    example = worked_example()
    body = json.dumps({"rotation": example["rotation"], "crank_span": example["crank_span"]})
    command = [sys.executable, "-c", READY, str(atlas), body]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    at_ready, matched, paths = map(set, json.loads(done.stdout.splitlines()[-1]))
    assert not at_ready & LATER.keys()
    assert not matched - at_ready
    assert {query.path for query in all_queries()} <= paths


HEAVY = ["fastapi", "starlette", "uvicorn", "pydantic", "scipy", "h5py", "numpy", "pywt", "ezdxf", "shtab", "tqdm"]


@pytest.mark.parametrize(
    ("arguments", "without"),
    [
        ("--help", HEAVY),
        ("--version", HEAVY),
        ("lift --help", ["pydantic_settings", "starlette", "scipy", "h5py", "pywt", "ezdxf", "shtab", "tqdm"]),
        ("synthesize --example worked_example", [*{*HEAVY} - {"pydantic", "numpy", "pywt"}, "app.scenes.lift"]),
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


@pytest.mark.parametrize("name", ["serve", "synthesize", "study", "example", "lift", "completion"])
def test_a_command_that_is_named_alone_takes_what_it_takes_among_all(name, capsys) -> None:
    texts = {"serve": "--port 7 --workers 3", "synthesize": "--rank 3 --set top=3"}
    texts |= {"study": "lines --out replies", "lift": "motion", "completion": "zsh"}
    alone, among = cli.make_parser(named=name), cli.make_parser(whole=True)
    made = [vars(parser.parse_args([name, *texts.get(name, "").split()])) for parser in (alone, among)]
    for values in made:
        del values["run"]
    assert made[0] == made[1]
    texts = []
    for parser in (alone, among):
        with pytest.raises(SystemExit):
            parser.parse_args([name, "--help"])
        texts.append(capsys.readouterr().out)
    assert texts[0] == texts[1] and f"linkage-atlas {name}" in texts[0]
