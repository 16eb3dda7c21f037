"""The committed description of the API is the description of the application.

A field that was changed without its documentation would show here.
"""

from app.openapi import FILE, description


def test_the_description_in_the_tree_is_current(monkeypatch) -> None:
    """And does not depend on the environment."""
    monkeypatch.setenv("LINKAGE_ATLAS_MAX_BODY_BYTES", "17")
    current = FILE.exists() and FILE.read_text() == description()
    assert current, (
        "docs/openapi.json is not the application's: renew it with `python -m app.openapi`, look at the change"
    )
