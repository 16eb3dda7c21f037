"""No file gets more unidiomatic phrases or vague names than it had when they were last counted.

Catches new text and new names that a reader has to decode. A file that is not listed may have a phrase in each 150 words.
"""

from __future__ import annotations

import json

from tests.prose import COUNTS, ROOT, count, files


def test_no_file_reads_worse_than_before() -> None:
    stored = json.loads(COUNTS.read_text())
    worse = {}
    for name in files():
        words, *found = count(ROOT / name)
        allowed = stored.get(name, [1 + words // 150, 0])
        if found[0] > allowed[0] or found[1] > allowed[1]:
            worse[name] = f"{found} phrases and vague names, at most {allowed}"
    assert not worse, "rewrite the text, then lower the counts with python -m tests.prose"
