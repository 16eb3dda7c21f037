"""`la.study`: the answers of `la.synthesize` in order, on processes and on a cluster, gone on with from a file."""

import json

import numpy as np
import pytest

import linkage_atlas as la
from linkage_atlas.batch import without_times


def motions(count: int) -> list[dict]:
    linkage = la.FourBar(1, 2.4, 2.2, 2.9, start_angle=20)
    turned = {span: linkage.joints(np.linspace(0, span, 7)).rotation for span in np.linspace(60, 140, count)}
    return [{"rotation": rotation, "crank_span": span, "top": 2} for span, rotation in turned.items()]


def plain(result: la.Result) -> dict:
    return json.loads(json.dumps(without_times(result.to_dict())))


def test_answers_are_those_of_synthesize() -> None:
    asked = motions(4)
    asked[2] = {"rotation": [1, 2], "crank_span": 10}
    asked.append({"position": np.array([0, 1 + 2j, 3 + 1j]), "crank_span": 60, "top": 1, "spin": 1})
    asked.append({"position": np.array([0, 1 + 2j, 3 + 1j]), "crank_span": 60, "top": 1})
    seen = []
    found = list(la.study(asked, jobs=1, progress=lambda *state: seen.append(state)))
    assert [row["line"] for row in found] == [1, 2, 3, 4, 5, 6] and seen == [(k, 6) for k in range(1, 7)]
    for k in (0, 1, 3, 5):
        assert found[k]["reply"] == plain(la.synthesize(**asked[k]))
    assert "wanted 3 to 1024 samples" in found[2]["error"] and "spin" in found[4]["error"]
    with pytest.raises(la.FieldError, match="requests, item 1: must hold numbers"):
        list(la.study([{"rotation": object()}], jobs=1))


def test_a_file_is_gone_on_with(tmp_path) -> None:
    out, asked = tmp_path / "answers.ndjson", motions(5)
    begun = la.study(asked, out, jobs=1)
    first = [next(begun), next(begun)]
    begun.close()
    assert [json.loads(line) for line in out.read_text().splitlines()] == first
    whole = list(la.study(asked, out, jobs=1))
    assert whole[:2] == first and [json.loads(line) for line in out.read_text().splitlines()] == whole
    with pytest.raises(la.FieldError, match="another request"):
        list(la.study(motions(4), out, jobs=1))
