"""Studies: the answers of `la.synthesize` in order, continued from a file that was cut off at any byte.

It would catch a lost or doubled answer after a kill, and a study that overwrites a file that is not its own.
"""

import json
from pathlib import Path

import numpy as np
import pytest

import linkage_atlas as la
from linkage_atlas.batch import Question, answer_line, answers, without_times


def motions(count: int) -> list[dict]:
    linkage = la.FourBar(1, 2.4, 2.2, 2.9, start_angle=20)
    turned = {span: linkage.joints(np.linspace(0, span, 7)).rotation for span in np.linspace(60, 140, count)}
    return [{"rotation": rotation, "crank_span": span, "top": 2} for span, rotation in turned.items()]


def plain(result: la.Result) -> dict:
    return json.loads(json.dumps(without_times(result.to_dict())))


def test_answers_are_those_of_synthesize() -> None:
    request = motions(4)
    request[2] = {"rotation": [1, 2], "crank_span": 10}
    request.append({"position": np.array([0, 1 + 2j, 3 + 1j]), "crank_span": 60, "top": 1, "spin": 1})
    request.append({"position": np.array([0, 1 + 2j, 3 + 1j]), "crank_span": 60, "top": 1})
    seen = []
    found = list(la.study(request, jobs=1, progress=lambda *state: seen.append(state)))
    assert [row["line"] for row in found] == [1, 2, 3, 4, 5, 6] and seen == [(k, 6) for k in range(1, 7)]
    for k in (0, 1, 3, 5):
        assert found[k]["reply"] == plain(la.synthesize(**request[k]))
    assert "give 3 to 1024 samples" in found[2]["error"] and "spin" in found[4]["error"]
    with pytest.raises(la.FieldError, match="requests, item 1: must hold numbers"):
        list(la.study([{"rotation": object()}], jobs=1))


def test_a_file_is_gone_on_with(tmp_path) -> None:
    out, request = tmp_path / "answers.ndjson", motions(5)
    started_from = la.study(request, out, jobs=1)
    first = [next(started_from), next(started_from)]
    started_from.close()
    assert [json.loads(line) for line in out.read_text().splitlines()] == first
    complete = list(la.study(request, out, jobs=1))
    assert complete[:2] == first and [json.loads(line) for line in out.read_text().splitlines()] == complete
    with pytest.raises(la.FieldError, match="another request"):
        list(la.study(motions(4), out, jobs=1))


# -- the file of answers ----------------------------------------------------------------------------------------------

QUESTIONS = [Question(2 * k + 1, b"%d" % k, f"{k:04x}") for k in range(5)]


def square(question: Question) -> bytes:
    number = int(question.text)
    return answer_line(question, {"square": number**2}, error="three is\nno number" if number == 3 else None)


def found(out: Path | None = None, work=square) -> list[bytes]:
    return list(answers(work, QUESTIONS, out, jobs=1))


def test_a_study_cut_off_at_any_byte_continues_to_the_same_bytes(tmp_path) -> None:
    out = tmp_path / "answers.ndjson"
    lines = found(out)
    complete = out.read_bytes()
    rows = [json.loads(line) for line in complete.splitlines()]
    assert lines == complete.splitlines() == found() and [row["line"] for row in rows] == [1, 3, 5, 7, 9]
    assert rows[3]["error"] == "three is no number" and rows[4]["reply"] == {"square": 16}
    for length in range(0, len(complete) + 1, 3):
        for tail in (b"", b"\0" * 50):  # zeros: left by a power cut
            out.write_bytes(complete[:length] + (tail if complete[:length].endswith(b"\n") else b""))
            computed: list[Question] = []
            assert found(out, lambda question, to=computed: to.append(question) or square(question)) == lines
            assert out.read_bytes() == complete and len(computed) == 5 - complete[:length].count(b"\n")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: b"x,y\n1,2\n", "not replies to these requests"),
        (lambda text: b"words without an end of line", "contains no replies"),
        (lambda text: text.replace(b"0002", b"0009"), "another request in line 5"),
        (lambda text: text.replace(b'"line": 5', b'"line": 6'), "not replies to these requests"),
        (lambda text: text + text, "not replies to these requests"),
        (lambda text: b"[]\n" + text, "not replies to these requests"),
    ],
)
def test_a_file_of_something_else_is_refused_and_left_as_it_is(change, words, tmp_path) -> None:
    out = tmp_path / "answers.ndjson"
    found(out)
    second = change(out.read_bytes())
    out.write_bytes(second)
    with pytest.raises(la.FieldError, match=words):
        found(out)
    assert out.read_bytes() == second
    with pytest.raises(la.FieldError, match="not a regular file"):
        found(tmp_path)
