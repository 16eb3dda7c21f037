"""A start imports only the modules that it needs.

A heavy library that delays every command would show here.
"""

import subprocess
import sys
from pathlib import Path

import pytest

from app import cli

ROOT = Path(__file__).parents[2]
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
    single, among = cli.make_parser(named=name), cli.make_parser(all_commands=True)
    built = [vars(parser.parse_args([name, *texts.get(name, "").split()])) for parser in (single, among)]
    for values in built:
        del values["run"]
    assert built[0] == built[1]
    texts = []
    for parser in (single, among):
        with pytest.raises(SystemExit):
            parser.parse_args([name, "--help"])
        texts.append(capsys.readouterr().out)
    assert texts[0] == texts[1] and f"linkage-atlas {name}" in texts[0]
