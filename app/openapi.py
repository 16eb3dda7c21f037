"""``python -m app.openapi``: write the description of the API to docs/openapi.json, so that a review shows its changes."""

from __future__ import annotations

import json
from pathlib import Path

from app.main import create_app, described
from app.settings import Settings

FILE = Path(__file__).parents[1] / "docs" / "openapi.json"


def description() -> str:
    """Return the description of the API as JSON; it depends only on the code, not on the environment or on an atlas."""
    return json.dumps(described(create_app(Settings.model_construct())), indent=1, sort_keys=True) + "\n"


if __name__ == "__main__":
    FILE.write_text(description())
    print(f"wrote {FILE}")
