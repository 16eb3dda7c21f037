"""Studies continue from a file of answers that was cut off at any byte.

It would catch a lost or doubled answer after a kill, and a study that overwrites a file that is not its own.
"""

import json
from pathlib import Path

import pytest

import linkage_atlas as la
from app.study import Question, answer_line, answers

QUESTIONS = [Question(2 * k + 1, b"%d" % k, f"{k:04x}") for k in range(5)]


def square(question: Question) -> bytes:
    number = int(question.text)
    return answer_line(question, {"square": number**2}, error="three is\nno number" if number == 3 else None)


def found(out: Path, work=square) -> list[bytes]:
    return list(answers(work, QUESTIONS, out, 1))


def test_a_study_cut_off_at_any_byte_continues_to_the_same_bytes(tmp_path) -> None:
    out = tmp_path / "answers.ndjson"
    lines = found(out)
    complete = out.read_bytes()
    rows = [json.loads(line) for line in complete.splitlines()]
    assert lines == complete.splitlines() and [row["line"] for row in rows] == [1, 3, 5, 7, 9]
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
