"""Commands write the files, pictures, tables and exit codes that their help describes.

A file of the wrong rank, format or unit, and an example that is no request, would show here.
"""

import json
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import ezdxf
import pytest

import linkage_atlas as la
from app.fourbar.models import SynthesizeRequest
from app.query import FILES
from app.registry import all_examples, all_queries, worked_example
from app.settings import Settings, atlas_of
from app.terminal import Exit
from linkage_atlas import atlases

QUERIES = {query.command: query for query in all_queries()}
SOLUTION = {
    "links": {"crank": 19, "coupler": 72, "rocker": 144, "ground": 165},
    "branch": 1,
    "start_angle": 30,
    "body_offset": -75.9054,
    "mount": {"ground_angle": 30, "pivot_a": [7.07, 7.07], "coupler_point_polar": {"radius": 20, "angle": 60}},
}
RIGHT_ANGLE = {"rotation": [0, 8, 19, 31, 40, 44], "crank_span": 90, "top": 2, "budget_ms": 400}


# -- files and pictures -----------------------------------------------------------------------------------------------


def test_one_answer_gives_table_and_files(run, tmp_path, monkeypatch) -> None:
    request = []
    monkeypatch.setattr("linkage_atlas.synthesize", lambda *a, f=la.synthesize, **o: request.append(1) or f(*a, **o))
    files = [tmp_path / f"one.{ending}" for ending in ("json", "svg", "plates.dxf")]
    exports = [word for file in files for word in ("--export", file)]
    code, out, err = run("synthesize", "--example", "worked_example", "--rank", 2, "--json", *exports)
    assert code == Exit.OK and len(request) == 1, "answered once, whatever is written"
    second = json.loads(out)["solutions"][1]
    written = json.loads(files[0].read_text())
    assert written["linkage"]["links"] == second["links"]
    assert SynthesizeRequest.model_validate(written["request"]).position == worked_example()["position"]
    title = ElementTree.parse(files[1]).getroot()[0].text
    assert f"crank {second['links']['crank']:.6g}, coupler {second['links']['coupler']:.6g}" in title
    assert err.splitlines() == [f"wrote {file}" for file in files]
    code, out, err = run("function", "--example", "five_pairs", "--export", tmp_path / "no" / "one.svg")
    assert code == Exit.FAILED and out.startswith("reached") and err.startswith("cannot write ")


def test_where_there_is_no_such_solution_nothing_is_written(run, tmp_path) -> None:
    file = tmp_path / "one.dxf"
    links = {"ground": 100, "crank": 10, "coupler": 10, "rocker": 10}
    request = {"output": [0, 10, 30], "crank_span": 60, "limits": {"links": links, "preset": None}}
    code, out, err = run("function", "--export", file, "--plot", stdin=json.dumps(request))
    assert code == Exit.INFEASIBLE and not file.exists()
    assert out.startswith("infeasible") and err == "There is no solution of rank 1; there are 0 solutions.\n"


@pytest.mark.parametrize("more", [(), ("--json",), ("--export", "one.svg")])
def test_a_rank_beyond_the_solutions_found_is_an_error_that_says_how_many_there_are(
    more, run, monkeypatch, tmp_path
) -> None:
    monkeypatch.chdir(tmp_path)
    poses = {"position": [[0, 0], [40, 8], [75, 30]], "rotation": [0, 15, 40]}
    request = json.dumps({**poses, "timing": "free", "budget_ms": 100})
    code, out, err = run("synthesize", "--rank", 100, *more, stdin=request)
    assert code == Exit.USAGE and "no solution of rank 100; there are " in err and out
    assert not (tmp_path / "one.svg").exists()
    assert run("synthesize", "--rank", 101, *more, stdin=request)[:2] == (Exit.USAGE, "")


@pytest.mark.parametrize(
    ("field", "words"),
    [
        ({"positon": [[0, 0]]}, "positon: there is no field 'positon'; near: position"),
        ({"limits": {"pivot_bx": 1}}, "limits.pivot_bx: there is no field 'pivot_bx'; near: pivot_box, pivot_b"),
        ({"limits": {"links": {"grund": 1}}}, "limits.links.grund: there is no field 'grund'; near: ground"),
        ({"motion": 1}, "motion: there is no field 'motion'; near: rotation, position"),
        ({"family": "any"}, "family: there is no field 'family'; near: limits.family"),
        ({"transmission_angle": 30}, "'transmission_angle'; near: limits.transmission_angle_min"),
        ({"limits": {"closed": 1}}, "limits.closed: there is no field 'closed'; near: closed"),
        ({"weights": {"zzz": 1}}, "weights.zzz: there is no field 'zzz'; there are rotation, position"),
        ({"z" * 999: 1}, "there is no field '" + 40 * "z" + "'; there are crank_span, "),
    ],
)
def test_a_field_that_is_not_known_is_told_with_those_near_it(field, words, run, tmp_path) -> None:
    code, out, err = run("synthesize", stdin=json.dumps(RIGHT_ANGLE | field))
    assert (code, out) == (Exit.USAGE, "") and words in err
    path, value = next(iter(field.items()))
    while isinstance(value, dict):
        path, value = f"{path}.{next(iter(value))}", next(iter(value.values()))
    code, _, err = run("synthesize", "--set", f"{path}=1", stdin=json.dumps(RIGHT_ANGLE))
    assert code == Exit.USAGE and words in err
    lines, replies = tmp_path / "lines", tmp_path / "replies"
    lines.write_text(json.dumps(RIGHT_ANGLE | field))
    assert run("study", lines, "--out", replies, "--jobs", 1)[0] == Exit.FAILED
    assert words in json.loads(replies.read_text())["error"]


def test_a_request_that_does_not_say_how_the_crank_turns_is_told_all_ways_to_say_it(run) -> None:
    code, _, err = run("synthesize", stdin='{"rotation": [0, 8, 19, 31]}')
    assert code == Exit.USAGE and all(word in err for word in ("`crank_span`", "`crank_angle`", "`position`"))
    with pytest.raises(la.FieldError) as error:
        la.synthesize([0, 8, 19, 31])
    assert str(error.value) == err.strip() and error.value.field == "/crank_span"
    code, _, err = run("function", stdin='{"output": [0, 8, 19, 31]}')
    assert code == Exit.USAGE and "`crank_span`" in err and "`input`" in err and "position" not in err


def test_a_file_of_unknown_ending_is_refused_before_anything_is_computed(run, monkeypatch) -> None:
    monkeypatch.setattr("linkage_atlas.synthesize", None)
    code, out, err = run("synthesize", "--example", "worked_example", "--export", "linkage.dwg")
    assert (code, out) == (Exit.USAGE, "") and "plates.dxf" in err


@pytest.mark.parametrize("command", ["synthesize", "function"])
def test_every_format_of_a_solution_is_written_from_the_reply(command, run, tmp_path, client) -> None:
    query = QUERIES[command]
    files = [tmp_path / f"one.{FILES[kind].endings[0]}" for kind in query.formats]
    name = {"synthesize": "worked_example", "function": "five_pairs"}[command]
    exports = [word for file in files for word in ("--export", file)]
    assert run(command, "--example", name, *exports)[0] == Exit.OK
    example = query.examples[name]
    body = {"request": example, "linkage": client.post(query.path, json=example).json()["solutions"][0]}
    for kind, file in zip(query.formats[:-1], files):
        if file.suffix == ".dxf":  # which is stamped
            assert not ezdxf.readfile(file).audit().errors
        else:
            assert file.read_bytes() == client.post(query.files.path, json={**body, "format": kind}).content
    assert json.loads(files[-1].read_text()).keys() >= {"request", "linkage"}


def test_an_export_does_not_replace_its_own_request(run, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    file, text = Path("one.json"), json.dumps(worked_example())
    file.write_text(text)
    code, _, err = run("export", "one.json")
    assert code != Exit.OK and "one.json is the file of the request" in err and file.read_text() == text
    assert run("export", "one.json", "--out", "two.json")[0] == Exit.OK
    for _ in range(2):  # with standard input an existing file is replaced
        assert run("export", stdin=text)[::2] == (
            Exit.OK,
            "read standard input: a request, which is solved\nwrote linkage.json\n",
        )


# -- tables from standard input ---------------------------------------------------------------------------------------


def test_a_pasted_table_on_standard_input(run, tmp_path) -> None:
    table = "x;y;phi\n0;0;0\n22;5;12\n41;17,5;27\n"
    file = tmp_path / "poses.txt"
    file.write_text(table)
    replies = []
    for arguments, stdin in ((["-"], table), ([], table), ([file], "")):
        code, out, err = run("synthesize", "--json", *arguments, stdin=stdin)
        assert (code, err) == (Exit.OK, "")
        replies.append(json.loads(out)["solutions"])
    assert replies[0] == replies[1] == replies[2]
    assert "crank angles of rank 1: 0, " in run("synthesize", file)[1]
    body = {"timing": "free", "position": [[0, 0], [22, 5], [41, 17.5]], "rotation": [0, 12, 27]}
    assert json.loads(run("synthesize", "--json", stdin=json.dumps(body))[1])["solutions"] == replies[0]


def test_fields_are_set_beside_a_table_or_a_request(run, tmp_path) -> None:
    table, limits = "x,y\n0,0\n22,5\n41,17.5\n", {"pivot_box": [-50, -60, 90, 80], "family": "any"}
    expected = {"position": [[0, 0], [22, 5], [41, 17.5]], "crank_span": 50, "limits": limits, "top": 2}
    fields = ["--set", "crank_span=50", "--set", "limits.family=any", "--set", "limits.pivot_box=[-50,-60,90,80]"]
    replies = [run("synthesize", "--json", stdin=json.dumps(expected))]
    replies.append(run("synthesize", "--json", *fields, "--set", "top=2", stdin=table))
    body = json.dumps({"position": expected["position"], "limits": {"family": "full_crank"}, "top": 9})
    replies.append(run("synthesize", "--json", *fields, "--set", "top=2", stdin=body))
    solutions = [json.loads(out)["solutions"] for _, out, _ in replies]
    assert len(solutions[0]) == 2 and solutions[0] == solutions[1] == solutions[2]
    refused = {"top": "FIELD=VALUE", "tip=3": "tip: ", "top=many": "top: ", "limits..top=1": "FIELD=VALUE"}
    for wrong, words in refused.items():
        code, out, err = run("synthesize", "--set", wrong, stdin=table)
        assert (code, out) == (Exit.USAGE, "") and words in err
    for text in ("[1]", '{"top": NaN}', "{"):
        assert run("synthesize", "--set", "top=1", stdin=text)[0] == Exit.USAGE


# -- exit codes -------------------------------------------------------------------------------------------------------


def test_the_codes_come_out_of_the_command(run) -> None:
    strict = {**RIGHT_ANGLE, "tolerances": {"rotation": 1e-6}}
    assert run("synthesize", stdin=json.dumps(strict))[0] == Exit.CLOSEST
    assert run("synthesize", stdin=json.dumps(RIGHT_ANGLE))[0] == Exit.OK
    assert run("knotter", "needle", stdin='{"alpha2": 70}')[0] == Exit.INFEASIBLE
    help_text = run("synthesize", "--help")[1]
    for code in Exit:
        assert f"\n  {code:<4} " in help_text


# -- examples, atlas --------------------------------------------------------------------------------------------------


def test_every_example_is_a_request_of_its_command(run) -> None:
    listed = run("example")[1]
    for name, example in all_examples().items():
        code, out, err = run("example", name)
        assert code == Exit.OK and f"linkage-atlas {example.command} FILE" in err
        assert f"\n{name.removeprefix('synthesize-')} " in listed
        assert json.loads(out) == example.request
        QUERIES[example.command].request.model_validate_json(out)
    assert run("example", "nothing")[0] == Exit.USAGE


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_knows_every_command_and_option(shell, run) -> None:
    code, out, _ = run("completion", shell)
    assert code == Exit.OK
    for word in ("synthesize", "knotter", "needle", "no-preset", "scheduler", "worked_example", "casement"):
        assert word in out
    if shell == "bash":
        assert subprocess.run(["bash", "-n"], input=out, text=True, capture_output=True).returncode == 0


def test_the_default_atlas_is_built_once_in_the_cache_folder(tmp_path, monkeypatch, capsys) -> None:
    builds = []

    def build(position: Path, jobs, progress) -> None:
        builds.append(position)
        progress(1, 1)
        position.write_bytes(b"atlas")

    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("LINKAGE_ATLAS_ATLAS", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("linkage_atlas.atlases.build_atlas", build)
    position = atlas_of(Settings())
    assert position == atlas_of(Settings()) == atlases.cached_atlas() and builds == [position]
    assert position.is_relative_to(tmp_path / "cache") and str(position) in capsys.readouterr().err
    named = tmp_path / "mine.h5"
    assert atlas_of(Settings(atlas=named)) == named, "one that is named is never built"
    (tmp_path / "atlas.h5").write_bytes(b"here")
    assert atlas_of(Settings()) == Path("atlas.h5")
    assert builds == [position]


# -- waiting ----------------------------------------------------------------------------------------------------------
