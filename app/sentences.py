"""Sentences for invalid requests: pydantic's errors in the user's terms, for HTTP, the command line and the page."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from linkage_atlas.arguments import suggestion

_NUMBER = "must be a number"
_WHOLE = "must be a whole number"
_LIST = "must be a list, as [1, 2]"
_OBJECT = 'must be an object, as {{"name": value}}'
_TEXT = "must be text"
SENTENCES = {
    "missing": "is required",
    "finite_number": "must be a finite number",
    **dict.fromkeys(("float_type", "float_parsing"), _NUMBER),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float", "int_parsing_size"), _WHOLE),
    **dict.fromkeys(("bool_type", "bool_parsing"), "must be true or false"),
    **dict.fromkeys(("string_type", "string_unicode"), _TEXT),
    **dict.fromkeys(("list_type", "tuple_type"), _LIST),
    **dict.fromkeys(("model_type", "model_attributes_type", "dict_type"), _OBJECT),
    "greater_than": "must be above {gt}",
    "greater_than_equal": "must be at least {ge}",
    "less_than": "must be below {lt}",
    "less_than_equal": "must be at most {le}",
    "too_short": "must have at least {min_length} {items}",
    "too_long": "must have at most {max_length} {items}",
    "string_too_short": "must have at least {min_length} characters",
    "string_too_long": "must have at most {max_length} characters",
    "literal_error": "must be {choices}",
    "enum": "must be {choices}",
    "union_tag_invalid": "must have a {discriminator} of {expected_tags}",
    "union_tag_not_found": "must have the field {discriminator}",
    "value_error": "{error}",
}
"""Predicates about a field by the type of pydantic's error; its context fills them in."""
SAMPLED = ("rotation", "position", "crank_angle", "travel", "output", "input", "weights")
"""Fields with a value for each sample."""
_SHAPES = {4: "must be four numbers, [xmin, ymin, xmax, ymax]", 2: "must be two numbers, [x, y]"}
_BOXES = re.compile(r".*_box|keep_out|envelope")
_LONGEST = 40


def sentence(error: Mapping[str, Any], quoting: bool = False) -> str:
    """State the allowed values of a field and the value that was found, as a predicate without the field's name.

    ``quoting`` repeats texts of the request, which replies over HTTP never do.
    """
    kind, context, value = error["type"], dict(error.get("ctx") or {}), error.get("input")
    if kind not in SENTENCES:
        return re.sub(r"^Input should be", "must be", str(error["msg"]))
    if kind in ("missing", "value_error") or kind.startswith("union"):
        return SENTENCES[kind].format(**context)
    if kind in ("too_short", "too_long"):
        count = context.get("min_length", context.get("max_length"))
        allowed = _shape_of(error["loc"], count) or SENTENCES[kind].format(
            **context, items=_items(error["loc"], count)
        )
        return f"{allowed}, found {context['actual_length']}"
    choices = re.findall(r"'([^']*)'", str(context.get("expected", "")))
    words = {name: _short(bound) if isinstance(bound, (int, float)) else bound for name, bound in context.items()}
    words["choices"] = f"one of {', '.join(choices)}" if len(choices) > 1 else context.get("expected")
    allowed = SENTENCES[kind].format(**words)
    if kind == "greater_than_equal" and 0 < context["ge"] < 1e-6:  # a bound that only excludes zero
        allowed = f"must be above 0, {allowed.removeprefix('must be ')}"
    if quoting or not isinstance(value, str):
        allowed += f", found {_short(value)}"
    elif not context:
        allowed += ", found text"
    return allowed + suggestion(value, choices)


def _items(loc: Sequence[str | int], count: Any) -> str:
    """Return the name of the items of a list, in the singular or plural."""
    noun = "sample" if any(name in SAMPLED for name in loc) and isinstance(loc[-1], str) else "item"
    return noun if count == 1 else noun + "s"


def _shape_of(loc: Sequence[str | int], count: Any) -> str | None:
    """Return the form of a box or point that has the wrong number of coordinates."""
    name = next((part for part in reversed(loc) if isinstance(part, str)), "")
    is_box = count == 4 and _BOXES.fullmatch(name) is not None
    is_point = count == 2 and (
        name in ("pivot_a", "pivot_b", "hand_point") or (name == "position" and name != loc[-1])
    )
    return _SHAPES[count] if is_box or is_point else None


def _short(value: Any) -> str:
    """Return a value of a request in a few characters."""
    if isinstance(value, bool) or value is None:
        return json.dumps(value)
    if isinstance(value, (int, float)):
        try:
            number = float(value)
        except OverflowError:
            return "a number beyond all bounds"
        if not math.isfinite(number):
            return "NaN" if math.isnan(number) else "infinity"
        return str(value) if isinstance(value, int) and abs(number) < 1e9 else f"{number:.6g}".replace("e+", "e")
    if isinstance(value, str):
        return "empty text" if not value else f"'{value[:_LONGEST]}{'...' if len(value) > _LONGEST else ''}'"
    if isinstance(value, (list, tuple)):
        return f"a list of {len(value)}" if value else "an empty list"
    return "an object" if isinstance(value, Mapping) else f"a value of type {type(value).__name__}"
