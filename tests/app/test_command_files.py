"""Each command reads the files that other commands and the page write, and fields set beside them are merged.

It would catch a command that refuses a saved solution, an option that wipes the request, or a drive missing in the answer.
"""

import json
from pathlib import Path

import pytest

from app.registry import all_queries, worked_example
from app.terminal import Exit
from tests.app.test_command import SOLUTION

EXAMPLE = worked_example()
TABLE = "x;y;phi\n0;0;0\n22;5;12\n41;17,5;27\n"
POSES = {"timing": "free", "position": [[0, 0], [22, 5], [41, 17.5]], "rotation": [0, 12, 27]}


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
    code, _, err = run("match", files[kind], "--set", "curve=none")
    assert code == Exit.USAGE and "without position" in err and "curve: must be one of coupler, rocker" in err


@pytest.mark.parametrize(
    ("command", "kind"),
    [("export", kind) for kind in ("saved", "reply", "http", "page", "answer", "linkage")]
    + [("drive", "reply"), ("drive", "linkage"), ("assembly", "saved"), ("assembly", "answer")],
)
def test_a_linkage_is_read_from_each_file(command, kind, run, files, tmp_path) -> None:
    out_file = tmp_path / "out.json"
    more = ["--out", out_file] if command == "export" else ["--json"]
    alone = kind in ("http", "answer", "linkage")
    file = [files["request"], "--linkage", files[kind]] if alone and command != "assembly" else [files[kind]]
    code, out, err = run(command, *file, "--rank", 2, *more)
    assert code == Exit.OK, err
    assert err.startswith("read ")
    if command == "export":
        found = json.loads(out_file.read_text())["solution"]["links"]
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
    assert code == Exit.USAGE and "the reply has 2 solutions, and none of rank 3" in err


@pytest.mark.parametrize("command", ["export", "assembly", "drive"])
def test_a_table_is_the_motion_of_every_command(command, run, files, tmp_path) -> None:
    more = ["--out", tmp_path / "one.svg"] if command == "export" else []
    if command == "drive":
        more = ["--linkage", tmp_path / "saved.json"]
        assert run("synthesize", "--family", "any", "--export", more[1], stdin=TABLE)[0] == Exit.OK
    code, _, err = run(command, "--set", "limits.family=any", *more, stdin=TABLE)
    assert code in (Exit.OK, Exit.INFEASIBLE) and "Columns read: x from 'x', y from 'y', angle from 'phi'." in err


def test_the_unit_of_a_table_is_kept_in_every_file(run, tmp_path) -> None:
    """A reply to a table in metres was drawn a thousand times too small."""
    rows = TABLE.replace("x;y", "x [m];y [m]")
    saved, reply, drawn = tmp_path / "saved.json", tmp_path / "reply.json", []
    code, out, _ = run("synthesize", "--family", "any", "--json", "--export", saved, stdin=rows)
    assert code == Exit.OK
    reply.write_text(out)
    for words in ([saved], [reply], [saved, "--set", "length_unit=mm"]):
        assert run("export", *words, "--out", tmp_path / "one.parts.csv")[0] == Exit.OK
        drawn.append(float((tmp_path / "one.parts.csv").read_text().splitlines()[1].split(",")[4]))
    # default widths are whole millimetres, so that the outlines of parts are not quite a thousand times as large
    assert drawn[0] == drawn[1] == pytest.approx(1000 * drawn[2], rel=0.02)
    assert "pos. max m " in run("synthesize", saved)[1]
    assert run("assembly", saved)[0] in (Exit.OK, Exit.INFEASIBLE) and run("drive", reply)[0] == Exit.OK


def test_the_request_of_a_machine_is_read_from_what_its_page_saves(run, tmp_path) -> None:
    file = tmp_path / "needle.json"
    file.write_text(json.dumps({"request": {"alpha2": 9}, "reply": {"status": "ok"}}))
    code, out, err = run("knotter", "needle", file)
    assert code == Exit.OK and "request is used" in err
    assert out == run("knotter", "needle", stdin='{"alpha2": 9}')[1]


def test_a_request_for_another_command_is_named(run, tmp_path) -> None:
    """All fields were listed as unknown."""
    pairs = run("example", "function-five_pairs")[1]
    for command in ("synthesize", "drive", "export"):
        code, _, err = run(command, stdin=pairs)
        assert code == Exit.USAGE and "this is a request for `linkage-atlas function`" in err
        assert len(err.splitlines()) == 1


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig"])
def test_json_of_windows_is_read(encoding, run, tmp_path) -> None:
    text = json.dumps(POSES).encode(encoding)
    assert run("export", "--set", "top=1", "--out", tmp_path / "one.svg", stdin=text)[0] == Exit.OK


# -- fields -----------------------------------------------------------------------------------------------------------


def test_one_field_of_the_motion_leaves_the_others(run, tmp_path) -> None:
    """`export TABLE --set request.limits.family=any` lost the table: "give rotation, position or both"."""
    written = []
    for path in ("limits.family", "request.limits.family"):
        file = tmp_path / f"{path}.json"
        code, _, err = run("export", "--out", file, "--set", f"{path}=any", "--set", "length_unit=cm", stdin=TABLE)
        assert code == Exit.OK, err
        written.append(json.loads(file.read_text()))
    assert written[0] == written[1]
    assert written[0]["request"]["position"] == POSES["position"]
    assert written[0]["request"]["limits"]["family"] == "any"


def test_objects_are_merged_and_items_count_from_one(run) -> None:
    body = POSES | {"limits": {"family": "any"}, "top": 1}
    merged = ["--set", 'limits={"link_max": 500}', "--set", "position.3=[41,17]", "--set", "drives.1.kind=rotary"]
    code, out, err = run("synthesize", "--json", *merged, stdin=json.dumps(body))
    assert code == Exit.OK, err
    request = json.loads(out)["request"]
    assert request["limits"] == {"family": "any", "link_max": 500}
    assert request["position"] == [[0, 0], [22, 5], [41, 17]] and request["drives"] == [{"kind": "rotary"}]
    for wrong in ("position.0=[1,2]", "position.5=[1,2]", "position.x=3"):
        code, _, err = run("synthesize", "--set", wrong, stdin=json.dumps(body))
        assert code == Exit.USAGE and "position: is a list: its items are set by 1 to 4" in err


def test_options_for_common_limits_are_fields(run) -> None:
    options = ["--family", "any", "--pivot-box", "-50,-60,90,80", "--link-min", 5, "--link-max", "200"]
    fields = ["limits.family=any", "limits.pivot_box=[-50,-60,90,80]", "limits.link_min=5", "limits.link_max=200"]
    options, fields = [*options, "--transmission", "30"], [*fields, "limits.transmission_angle_min=30"]
    sets = [word for field in fields for word in ("--set", field)]
    replies = [json.loads(run("synthesize", "--json", *words, stdin=TABLE)[1]) for words in (options, sets)]
    assert replies[0]["request"] == replies[1]["request"] and len(replies[0]["request"]["limits"]) == 5
    assert replies[0]["solutions"] == replies[1]["solutions"]
    for command in ("function", "export", "assembly"):
        assert "--link-max" in run(command, "--help")[1]
    parts = ("--hole", "--width", "--thickness", "--clearance", "--scale", "--boards", "--heads", "--nevertheless")
    assert all(f"  {option}" in run("export", "--help")[1] for option in parts)


def test_the_value_of_a_field_may_be_a_file(run, files, tmp_path) -> None:
    limits, poses = tmp_path / "limits.json", tmp_path / "poses.csv"
    limits.write_text('{"family": "any"}')
    poses.write_text(TABLE)
    words = [f"limits=@{limits}", f"position=@{poses}", "timing=free", "top=1"]
    code, out, err = run("synthesize", "--json", *[word for field in words for word in ("--set", field)])
    assert code == Exit.OK, err
    asked = {"limits": {"family": "any"}, "position": POSES["position"], "timing": "free", "top": 1}
    assert json.loads(out)["request"] == asked
    code, out, _ = run("synthesize", files["request"], "--json", "--set", f"start_from=@{files['reply']}")
    first = json.loads(files["reply"].read_text())["solutions"][0]
    assert code == Exit.OK and json.loads(out)["request"]["start_from"][0]["links"] == first["links"]
    for wrong, words in (("limits=@none.json", "No such file"), (f"travel=@{poses}", "no column for travel")):
        code, _, err = run("synthesize", "--set", wrong, stdin=TABLE)
        assert code == Exit.USAGE and words in err


def test_columns_are_chosen_by_their_heads(run) -> None:
    rows = "TX [cm];TY [cm];RZ [deg];Force\n0;0;0;9\n2,2;0,5;12;9\n4,1;1,75;27;9\n"
    code, out, _ = run("synthesize", "--json", "--columns", "x=TX,y=TY,angle=RZ", stdin=rows)
    assert code == Exit.OK and json.loads(out)["request"]["position"][2] == [4.1, 1.75]
    code, _, err = run("synthesize", "--columns", "x=TX,y=TZ", stdin=rows)
    assert code == Exit.USAGE and "'TZ' is no column" in err
    assert run("synthesize", "--columns", "TX", stdin=rows)[0] == Exit.USAGE
    assert run("synthesize", "--columns", "x=TX", stdin=json.dumps(POSES))[0] == Exit.USAGE


def test_too_few_numbers_of_a_box_are_no_rows_of_the_table(run) -> None:
    """It said "request: wanted at least 4 rows"."""
    code, _, err = run("synthesize", "--pivot-box", "0,0,90", stdin=TABLE)
    assert (code, err) == (Exit.USAGE, "limits.pivot_box: must be four numbers, [xmin, ymin, xmax, ymax], found 3\n")


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


@pytest.mark.parametrize(
    ("words", "stdin", "said"),
    [
        (["biuld"], "", "did you mean build?"),
        (["README.md"], "", "name a command before the file: linkage-atlas synthesize README.md"),
        (["synthesize", "README.mdd"], "", "README.mdd: No such file or directory; did you mean README.md?"),
        (["synthesize", "app"], "", "app: Is a directory"),
        (["synthesize", "-"], "", "standard input: is empty"),
        (["synthesize", "docs/img/page.png"], "", "docs/img/page.png: this is "),
        (["synthesize", "--famly", "any"], TABLE, "unrecognized arguments: --famly; did you mean --family?"),
        (["synthesize", "--pivot-box", "0", "0", "9", "9"], TABLE, "a list is written with commas"),
        (["synthesize", "--family", "anny"], TABLE, "limits.family: must be one of full_crank, "),
        (["synthesize", "--link-min", "short"], TABLE, "limits.link_min: must be a number, found 'short'"),
        (["synthesize", "--length-unit", "inches"], TABLE, "argument --length-unit: invalid choice: 'inches'"),
        (["synthesize", "--rank", "x"], TABLE, "must be a whole number from 1 to 100, found x"),
        (["synthesize", "--set", "top"], TABLE, "must be FIELD=VALUE"),
        (["synthesize", "--set", "drives=rotary"], TABLE, "drives: must be a list, as [1, 2], found 'rotary'"),
        (["synthesize", "--export"], TABLE, "argument --export: expected one argument"),
        (["export", "--out", "one.dwg"], TABLE, "out: the file must end in one of"),
        (["example", "casment"], "", "did you mean casement?"),
        (["lift", "motion", "--set", "design.l2=x"], '{"design": {}}', "design.l2: must be a number, found 'x'"),
    ],
    ids=lambda value: " ".join(value)[:40] if isinstance(value, list) else None,
)
def test_a_typical_mistake_is_answered_with_what_to_do(words, stdin, said, run) -> None:
    code, out, err = run(*words, stdin=stdin)
    assert (code, out) == (Exit.USAGE, "") and said in err and "Traceback" not in err


# -- drives -----------------------------------------------------------------------------------------------------------

DRIVES = [{"kind": kind} for kind in ("rotary", "actuator", "dyad", "toggle")]


def test_the_drives_and_springs_of_a_solution_are_described(run) -> None:
    """The terminal did not mention them."""
    asked = EXAMPLE | {
        "top": 1,
        "start_from": [SOLUTION],
        "local": True,
        "drives": DRIVES,
        "load": {"force": [0, -100]},
    }
    asked |= {"springs": [{"kind": "tension"}, {"kind": "gas"}]}
    code, out, _ = run("synthesize", "--length-unit", "mm", stdin=json.dumps(asked))
    reply = json.loads(run("synthesize", "--json", stdin=json.dumps(asked))[1])["solutions"][0]
    assert code == Exit.OK
    kinds = {"rotary": "rotary drive", "actuator": "actuator", "dyad": "motor with a rod", "toggle": "knee"}
    assert {drive["kind"] for drive in reply["drives"]} == kinds.keys()
    for drive in reply["drives"]:
        words = out.partition(f"drive of rank 1: {kinds[drive['kind']]} on the {drive['link']}")[2].partition(
            "drive of"
        )[0]
        assert drive["stops"] in words and drive["holds"] in words
        for name in ("peak_force", "peak_torque"):
            assert name not in drive or f"{drive[name]:.5g}" in words, name
        assert "stroke" not in drive or f"stroke {drive['stroke']:.4g} mm" in words
        assert "pin" not in drive or f"({drive['pin'][0]:.5g}, {drive['pin'][1]:.5g})" in words
    for spring in reply["springs"]:
        words = out.partition(f"; stiffness {spring['stiffness']:.4g}; ")[2].splitlines()
        assert (
            f"{spring['torque']['before']['rms']:.5g} without" in words[0]
            and words[1] == f"  by itself: {spring['stays']}"
        )
    for no in reply["refused"]:
        is_spring = no["kind"] in ("tension", "gas")
        links = f"spring between {no['link'].replace('-', ' and ')}" if is_spring else f"on the {no['link']}"
        assert f"no {no['kind']} {links}" in out


def test_the_place_of_a_missing_spring_is_named_by_its_links(run) -> None:
    """The answer was "no gas on the ground-rocker"."""
    request: dict = {"rocker": {"pivot": [0, 0], "start": 0, "swing": 60, "length": 500}, "drives": []}
    for spring, links in (
        ({"between": ["ground", "rocker"]}, "ground and rocker"),
        ({}, "any two links"),
    ):
        code, out, err = run("drive", stdin=json.dumps(request | {"springs": [{"kind": "gas"} | spring]}))
        assert code == Exit.OK and f"no gas spring between {links}: there is no load to balance" in out, out + err


def test_drives_of_a_reply_carry_the_load_of_its_request(run, tmp_path) -> None:
    """The load was dropped, and the drives were found for no load."""
    request = EXAMPLE | {
        "top": 1,
        "start_from": [SOLUTION],
        "local": True,
        "load": {"force": [0, -100]},
        "drives": DRIVES[:1],
    }
    peak, reply = 0.0, tmp_path / "reply.json"
    reply.write_text(run("synthesize", "--json", stdin=json.dumps(request))[1])
    for more in ([], ["--set", "load.force=[0, -200]"]):
        code, out, err = run("drive", reply, "--json", "--set", 'drives=[{"kind": "rotary"}]', *more)
        assert code == Exit.OK, err
        answer = json.loads(out)
        torque = answer["drives"][0]["peak_torque"]
        assert not answer["notes"] and torque > 0
        if more:
            assert torque == pytest.approx(2 * peak)
        peak = torque


def test_an_empty_file_is_called_empty(run, tmp_path) -> None:
    """Beside an option it was taken for a request without fields."""
    file = tmp_path / "empty.csv"
    file.write_text("\n")
    for more in ([], ["--family", "any"]):
        code, _, err = run("synthesize", file, *more)
        assert code == Exit.USAGE and err.startswith(f"{file}: the file is empty"), err


def test_crank_angles_of_a_long_motion_are_shortened(run) -> None:
    """Hundreds of them filled the terminal."""
    position = [[k, (k / 40) ** 2] for k in range(30)]
    code, out, err = run("synthesize", "--set", "top=1", stdin=json.dumps({"timing": "free", "position": position}))
    (line,) = [line for line in out.splitlines() if line.startswith("crank angles of rank 1")]
    assert code == Exit.OK and "(14 more)" in line and len(line.split(",")) == 17, err


def test_a_wanted_drive_that_does_not_exist_is_said(run) -> None:
    wish = {"kind": "actuator", "stroke": 1, "retracted": 1e5, "ground_box": [0, 0, 1, 1]}
    asked = EXAMPLE | {"top": 1, "start_from": [SOLUTION], "local": True, "drive": wish}
    code, out, _ = run("synthesize", stdin=json.dumps(asked))
    assert (
        code == Exit.OK and "rank 1 has no drive within the limits of `drive`" in out and "no actuator on the" in out
    )
