"""Studies as files: cut off at any byte they are gone on with to the same bytes, and what is no study is left alone."""

import contextlib
import json
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from linkage_atlas import many_requests
from linkage_atlas.many_requests import Question, StudyLocked, answer_file, answer_of, in_order, is_error, study_lines
from synthesis.errors import FieldError
from tests.conftest import PATIENCE

QUESTIONS = [Question(2 * k + 1, b"%d" % k, f"{k:04x}") for k in range(7)]


def square(question: Question) -> bytes:
    k = int(question.text)
    if k == 3:
        return answer_of(question, error="three is\nno number")
    return answer_of(question, json.dumps({"square": k * k}).encode())


def late_square(question: Question) -> bytes:
    """The earlier, the later: answers come in any order but their own."""
    time.sleep(0.002 * (5 - int(question.text) % 6))
    return square(question)


def answers(out: Path | None, work=square, questions=QUESTIONS) -> list[tuple[bytes, bool]]:
    return list(study_lines(work, lambda: iter(questions), len(questions), out, ThreadPoolExecutor(3), 3))


@pytest.fixture
def whole(tmp_path) -> bytes:
    out = tmp_path / "whole.ndjson"
    answers(out)
    return out.read_bytes()


def test_answers_stand_in_the_order_of_the_questions(tmp_path, whole) -> None:
    rows = [json.loads(line) for line in whole.splitlines()]
    assert [row["line"] for row in rows] == [1, 3, 5, 7, 9, 11, 13] and [row["key"] for row in rows][2] == "0002"
    assert rows[4]["reply"] == {"square": 16} and rows[3]["error"] == "three is no number"
    assert [is_error(line) for line in whole.splitlines()] == [k == 3 for k in range(7)]
    assert [line for line, _ in answers(None, late_square)] == whole.splitlines()


def test_a_study_cut_off_at_any_byte_goes_on_to_the_same_bytes(tmp_path, whole) -> None:
    out = tmp_path / "cut.ndjson"
    ends = [k for k, byte in enumerate(whole) if byte == ord("\n")]
    near = {k + off for k in (0, *ends, len(whole)) for off in (-1, 0, 1, 2)}
    for length in sorted((near | {*range(0, len(whole), 7)}) & {*range(len(whole) + 1)}):
        out.write_bytes(whole[:length])
        found = answers(out)
        assert out.read_bytes() == whole, length
        assert sum(there for _, there in found) == whole[:length].count(b"\n")
        assert [line for line, _ in found] == whole.splitlines()


def test_a_tail_that_a_power_cut_left_empty_is_written_anew(tmp_path, whole) -> None:
    out = tmp_path / "cut.ndjson"
    for length in (0, 20, whole.index(b"\n") + 1, len(whole) // 2):
        for tail in (b"\0" * 50, b"\0" * 50 + b"\n"):
            out.write_bytes(whole[:length] + tail)
            answers(out)
            assert out.read_bytes() == whole


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: b"x,y\n1,2\n", "no answers to these requests"),
        (lambda text: b"\x89PNG\r\n\x1a\n\0\0", "no answers"),
        (lambda text: b"words without an end of line", "holds no answers"),
        (lambda text: text.replace(b"0002", b"0009"), "line 5 to another request"),
        (lambda text: text.replace(b'"line": 5', b'"line": 6'), "no answers to these requests"),
        (lambda text: text + text, "no answers to these requests"),
        (lambda text: b"[]\n" + text, "no answers to these requests"),
    ],
)
def test_what_is_no_beginning_of_this_study_is_refused_and_left_as_it_is(change, words, tmp_path, whole) -> None:
    out = tmp_path / "other.ndjson"
    out.write_bytes(change(whole))
    with pytest.raises(FieldError, match=words):
        answers(out)
    assert out.read_bytes() == change(whole)


def test_two_studies_of_one_file_are_refused(tmp_path) -> None:
    out = tmp_path / "one.ndjson"
    with answer_file(out), pytest.raises(StudyLocked, match="another study"):
        answers(out)
    answers(out)
    (tmp_path / "folder").mkdir()
    with pytest.raises(FieldError, match="no regular file"):
        answers(tmp_path / "folder")


def test_a_finished_study_starts_no_processes(tmp_path) -> None:
    out = tmp_path / "one.ndjson"
    answers(out)

    @contextlib.contextmanager
    def never() -> Iterator[None]:
        pytest.fail("entered")
        yield

    assert len(list(study_lines(square, lambda: iter(QUESTIONS), 7, out, never(), 2))) == 7


def test_no_more_is_under_way_than_is_allowed(monkeypatch) -> None:
    monkeypatch.setattr(many_requests, "AHEAD", 4)
    begun, gate = [], threading.Event()

    def work(question: Question) -> bytes:
        begun.append(question)
        gate.wait(PATIENCE)
        return b""

    many = [Question(k, b"", "") for k in range(1, 60)]
    taken: list[Question] = []
    with ThreadPoolExecutor(40) as executor:
        found = in_order(work, (taken.append(one) or one for one in many), executor, 2)
        threading.Timer(0.1, gate.set).start()
        next(found)
        assert len(taken) == 8
        found.close()


def test_a_study_that_is_stopped_keeps_what_it_has(tmp_path, whole) -> None:
    out, stop = tmp_path / "one.ndjson", threading.Event()
    study = study_lines(late_square, lambda: iter(QUESTIONS), 7, out, ThreadPoolExecutor(1), 1, stop.is_set)
    got = [next(study)[0] for _ in range(3)]
    stop.set()
    with pytest.raises(KeyboardInterrupt):
        list(study)
    assert out.read_bytes().splitlines() == got == whole.splitlines()[:3]
    answers(out)
    assert out.read_bytes() == whole
