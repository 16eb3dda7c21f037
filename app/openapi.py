"""``python -m app.openapi``: writes the API's description to docs/openapi.json, so that changes of it show in a review."""

from __future__ import annotations

import json
from pathlib import Path

from app.main import create_app, described
from app.settings import Settings

PLACE = Path(__file__).parents[1] / "docs" / "openapi.json"


def description() -> str:
    """The description as text. Law: depends on the code alone, not on the environment or on an atlas."""
    return json.dumps(described(create_app(Settings.model_construct())), indent=1, sort_keys=True) + "\n"


if __name__ == "__main__":
    PLACE.write_text(description())
    print(f"wrote {PLACE}")
