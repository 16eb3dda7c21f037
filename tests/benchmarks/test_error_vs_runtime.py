"""In words until when the strongest baseline leads."""

from __future__ import annotations

from benchmarks.error_vs_runtime import BUDGETS_MS, SERVICE, STRONGEST, lead
from tests.oracles.classes import EXACT


def test_a_baseline_leads_until_the_service_has_solved_as_many() -> None:
    """Shares are by the time of each case, not by a median or a budget; an answer above 1e-9 or none counts never."""
    method, setting = STRONGEST

    def runs(ours: dict, theirs: dict) -> dict:
        return {kind: {SERVICE: {f"budget {BUDGETS_MS[-1]} ms": ours}, method: {setting: theirs}} for kind in EXACT}

    ours = {"ms": [4.5, 20.5, 20.5, 250.0], "J": [1e-15, 1e-12, 1e-15, 1e-15]}
    theirs = {"ms": [2.5, 3.5, 30.5, 40.5], "J": [1e-15, 1e-12, 1e-3, None]}
    text = lead(runs(ours, theirs))
    assert "until 20 ms" in text and "50 % against 0 % within 4 ms" in text and "50 % against 100 %" in text
    assert lead(runs(ours, ours)) == "it is never ahead of the service"
