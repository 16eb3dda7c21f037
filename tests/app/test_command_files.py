"""Each command reads the files that other commands and the page write, and fields set beside them are merged.

It would catch a command that refuses a saved solution, an option that wipes the request, or a drive missing in the answer.
"""

import json
import re
from pathlib import Path

import pytest

from app.registry import all_queries, worked_example
from app.terminal import Exit
from tests.app.test_command import SOLUTION

EXAMPLE = worked_example()
TABLE = "x;y;phi\n0;0;0\n22;5;12\n41;17,5;27\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("files")


@pytest.fixture
def files(run, folder) -> dict[str, Path]:
    """One file of each kind, made by the commands themselves."""
    names = {
        name: folder / f"{name}.json" for name in ("request", "saved", "reply", "http", "page", "answer", "linkage")
    }
    if not names["linkage"].exists():
        names["request"].write_text(json.dumps(EXAMPLE | {"top": 2}))
        code, out, _ = run("synthesize", names["request"], "--rank", 2, "--json", "--export", names["saved"])
        assert code == Exit.OK
        reply = json.loads(out)
        names["reply"].write_text(out)
        reply.pop("request")
        names["http"].write_text(json.dumps(reply))
        names["page"].write_text(json.dumps({"request": EXAMPLE, "reply": reply}))
        names["answer"].write_text(json.dumps({"line": 1, "key": "0", "reply": reply}))
        names["linkage"].write_text(json.dumps(reply["solutions"][1]))
    return names


@pytest.mark.parametrize("kind", ["saved", "reply", "page"])
def test_the_request_in_a_file_is_solved(kind, run, files) -> None:
    """A saved solution was refused: "there is no field 'request'"."""
    code, out, err = run("synthesize", files[kind], "--set", "top=1", "--json")
    assert code == Exit.OK and err.startswith(f"read {files[kind]}: a ") and "request is used" in err
    assert json.loads(out)["request"]["position"] == EXAMPLE["position"]
    code, _, err = run("match", files[kind], "--set", "top=0")
    assert code == Exit.USAGE and "without position" in err and "top: must be at least 1" in err


@pytest.mark.parametrize(
    ("command", "kind"),
    [("export", kind) for kind in ("saved", "reply", "http", "page", "answer", "linkage")]
    + [("drive", "reply"), ("drive", "linkage"), ("assembly", "saved"), ("assembly", "answer")],
)
def test_a_linkage_is_read_from_each_file(command, kind, run, files, tmp_path) -> None:
    out_file = tmp_path / "out.json"
    more = ["--out", out_file] if command == "export" else ["--json"]
    single = kind in ("http", "answer", "linkage")
    file = [files["request"], "--linkage", files[kind]] if single and command != "assembly" else [files[kind]]
    code, out, err = run(command, *file, "--rank", 2, *more)
    assert code == Exit.OK, err
    assert err.startswith("read ")
    if command == "export":
        found = json.loads(out_file.read_text())["linkage"]["links"]
        assert found == json.loads(files["reply"].read_text())["solutions"][1]["links"]
    else:
        assert json.loads(out)[{"drive": "drives", "assembly": "layers"}[command]]


def test_a_reply_without_its_request_says_what_to_do(run, files) -> None:
    code, _, err = run("export", files["http"])
    assert code == Exit.USAGE and "the reply with --linkage" in err
    for kind in ("http", "linkage"):
        code, _, err = run("synthesize", files[kind])
        assert code == Exit.USAGE and f"{files[kind]}: this is a " in err and "without its request" in err
    code, _, err = run("drive", files["reply"], "--rank", 3)
    assert code == Exit.USAGE and "the reply has 2 solutions, but no solution of rank 3" in err


@pytest.mark.parametrize("command", ["export", "assembly", "drive"])
def test_a_table_is_the_motion_of_every_command(command, run, files, tmp_path) -> None:
    more = ["--out", tmp_path / "one.svg"] if command == "export" else []
    if command == "drive":
        more = ["--linkage", tmp_path / "saved.json"]
        assert run("synthesize", "--family", "any", "--export", more[1], stdin=TABLE)[0] == Exit.OK
    code, _, err = run(command, "--set", "limits.family=any", *more, stdin=TABLE)
    assert code in (Exit.OK, Exit.INFEASIBLE) and "Columns read: x from 'x', y from 'y', angle from 'phi'." in err


# -- help and mistakes ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("query", all_queries(), ids=lambda query: query.command)
def test_the_help_lists_every_field(query, run) -> None:
    code, out, _ = run(*query.command.split(), "--help")
    listed = {
        line.split()[0]
        for line in out.partition("fields of the request")[2].splitlines()
        if line[:2] == "  " != line[2:4]
    }
    assert code == Exit.OK and query.request.model_fields.keys() - {"request"} <= listed
    if query.command == "synthesize":
        assert {"limits.pivot_box", "limits.links.crank", "analysis.load.masses", "assembly.boards"} <= listed


MISTAKES = json.loads(Path(__file__).with_name("mistakes.json").read_text())
"""Words of a command, its standard input, and words of the message."""


@pytest.mark.parametrize(("words", "stdin", "said"), MISTAKES, ids=[" ".join(row[0])[:40] for row in MISTAKES])
def test_a_typical_mistake_is_answered_with_what_to_do(words, stdin, said, run) -> None:
    code, out, err = run(*words, stdin=stdin)
    assert (code, out) == (Exit.USAGE, "") and said in err and "Traceback" not in err


# -- drives -----------------------------------------------------------------------------------------------------------

DRIVES = [{"kind": kind} for kind in ("rotary", "actuator", "dyad")]


def test_the_drives_and_springs_of_a_solution_are_described(run) -> None:
    """The terminal did not mention them."""
    request = EXAMPLE | {
        "top": 1,
        "start_from": [SOLUTION],
        "refine_only": True,
        "drives": DRIVES,
        "load": {"force": [0, -100]},
    }
    request |= {"springs": [{"kind": "tension"}, {"kind": "gas"}]}
    code, out, _ = run("synthesize", "--length-unit", "mm", stdin=json.dumps(request))
    reply = json.loads(run("synthesize", "--json", stdin=json.dumps(request))[1])["solutions"][0]
    assert code == Exit.OK
    assert {drive["kind"] for drive in reply["drives"]} == {drive["kind"] for drive in DRIVES}
    for drive in reply["drives"]:
        row, words = re.findall(rf"^ *{drive['kind']} +(?:on the )?{drive['link']}.*", out, re.MULTILINE)
        assert drive["stops"] in words and drive["holds"] in words
        for name in ("peak_force", "peak_torque", "stroke"):
            assert name not in drive or f" {drive[name]:.6g} " in row, name
        assert "pin" not in drive or f"({drive['pin'][0]:.5g}, {drive['pin'][1]:.5g})" in row
    for spring in reply["springs"]:
        (row,) = re.findall(rf"^ *{spring['kind']} .* {spring['stiffness']:.6g} .*", out, re.MULTILINE)
        assert f" {spring['torque']['before']['rms']:.4g} -> " in row and row.endswith(spring["motion_at_ends"])
    for no in reply["refused"]:
        is_spring = no["kind"] in ("tension", "gas")
        links = f"spring between {no['link'].replace('-', ' and ')}" if is_spring else f"on the {no['link']}"
        assert f"no {no['kind']} {links}" in out
