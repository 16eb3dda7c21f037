"""Checks of arguments by name: numbers, columns, points, boxes, units, and names of fields."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from typing import Any, TypeAlias, TypeVar

import numpy as np

from linkage_atlas.cells import UNITS
from synthesis.arrays import Floats
from synthesis.errors import FieldError
from synthesis.target import MAX_LENGTH

MILLIMETRES = {"um": 0.001, "mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "ft": 304.8}
"""Units of length and their millimetres."""
_LONGEST_WORD = 40
"""Number of characters of a word for which similar words are searched."""
LARGEST = 1e12
"""Largest speed, force, torque or mass, in the user's units."""
Fields: TypeAlias = Mapping[str, object]
"""Fields of a request by name; their values are not checked yet."""


W = TypeVar("W", bound=str)
T = TypeVar("T")


@contextmanager
def pointing(field_of: Callable[[str], str]) -> Iterator[None]:
    """Replace the field of each FieldError within by ``field_of(field)``, its path in the request."""
    try:
        yield
    except FieldError as error:
        raise FieldError(field_of(error.field), error.message, **error.details) from error


def radians_in(degrees: bool) -> float:
    """Return the radians in a unit of angle: a degree or a radian."""
    return np.pi / 180 if degrees else 1.0


def millimetres_in(unit: object, where: str = "") -> float:
    """Return the millimetres in a unit of length; ``where``: path of its field in error messages."""
    return MILLIMETRES[one_of(f"{where}length_unit", unit, MILLIMETRES)]


def read_length_unit(unit: object) -> str | None:
    """Return a unit of length after a check; None if there is none."""
    return None if unit is None else str(one_of("length_unit", unit, MILLIMETRES))


def one_of(field: str, value: object, known: Iterable[W]) -> W:
    """Return a known word; raise FieldError with the known words for any other value."""
    words = tuple(known)
    for word in words:
        if value == word:
            return word
    raise FieldError(f"/{field}", f"must be one of {', '.join(words)}; it is {value!r}{suggestion(value, words)}")


def suggestion(value: object, words: Iterable[str]) -> str:
    """Return the end of an error message, "; did you mean m?": the word for the unit that is spelled out, or the nearest word."""
    known = {word.lower(): word for word in words}
    known |= {spelling: unit for spelling, unit in UNITS.items() if unit in known and spelling not in known}
    nearest = get_close_matches(str(value).strip()[:_LONGEST_WORD].lower(), known, 1)
    return f"; did you mean {known[nearest[0]]}?" if nearest else ""


def number(field: str, value: object, minimum: float = -np.inf) -> float:
    """Return a finite number of at least ``minimum``; raise FieldError for any other value."""
    try:
        found = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise FieldError(f"/{field}", f"must be a number; it is {value!r}") from None
    if not (np.isfinite(found) and found >= minimum):
        bound = "" if minimum == -np.inf else f" of at least {minimum:g}"
        raise FieldError(f"/{field}", f"must be a finite number{bound}")
    return found


def check_top(top: int) -> None:
    """Raise FieldError unless ``top`` is a positive whole number."""
    if not isinstance(top, (int, np.integer)) or top < 1:
        raise FieldError("/top", f"must be a whole number of at least 1; it is {top!r}")


def check_above_zero(**values: object) -> None:
    """Raise FieldError for an argument that is not above zero; None is allowed."""
    for name, value in values.items():
        if value is not None:
            positive(name, value, "number")


def column(name: str, values: object) -> Floats:
    """Return values as an array of numbers; raise FieldError if they are no numbers."""
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):  # numpy would use the masked values
        raise FieldError(f"/{name}", "must be numbers without a mask; use None for a missing number")
    if isinstance(values, np.ndarray) and values.dtype == object:  # as a list, in which None is a missing number
        values = values.tolist()
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise FieldError(f"/{name}", "must be numbers") from None


def check_names(where: str, names: Iterable[str], known: Sequence[str], what: str = "field") -> None:
    """Raise FieldError for a name that is not known; the error lists similar names."""
    for name in names:
        if name not in known:
            raise FieldError.no_such(where, name, known, what)


def check_required(where: str, values: Fields, names: Iterable[str]) -> None:
    """Raise FieldError for a field that is missing or None; ``where``: path of the fields, with a slash at its end."""
    for name in names:
        if values.get(name) is None:
            raise FieldError(f"/{where}{name}", "is required")


def known_fields(field: str, value: object, names: tuple[str, ...]) -> dict[str, Any]:
    """Return the fields of a mapping that are not None; raise FieldError for an unknown name."""
    where = f"/{field}" if field else ""
    if not isinstance(value, Mapping):
        raise FieldError(where, f"must be a mapping of {', '.join(names)}")
    found = {name: item for name, item in value.items() if item is not None}
    check_names(where, found, names)
    return found


def read_fields(where: str, values: object, readers: Mapping[str, Callable[[str, Any], Any]]) -> dict[str, Any]:
    """Return the checked fields of a mapping that are not None; raise FieldError for a wrong value or an unknown name.

    Parameters
    ----------
    where : str
        Path of the fields in error messages, with a slash at its end.
    values : mapping
        Fields by name.
    readers : mapping
        For each known name ``read(field, value)``, which returns the checked value or raises FieldError.
    """
    known = known_fields(where.rstrip("/"), values, tuple(readers))
    return {name: readers[name](f"{where}{name}", value) for name, value in known.items()}


def positive(field: str, value: object, noun: str = "length") -> float:
    """Return a finite number above 0; raise FieldError for any other value."""
    found = number(field, value)
    if not found > 0:
        raise FieldError(f"/{field}", f"must be a {noun} above 0; it is {found:g}")
    return found


def kinds_among(value: object, known: Sequence[str], there_are: str = "") -> list[str]:
    """Return the requested kinds of mechanism, each once and in the order of ``known``, from a list, a name or "all"."""
    if isinstance(value, str) and value == "all":
        return list(known)
    names = [value] if isinstance(value, str) else list(value) if isinstance(value, Iterable) else []
    if not names:
        raise FieldError("/mechanisms", f"must be a list of {', '.join(known)}, or 'all'")
    for index, name in enumerate(names):
        if name not in known:
            words = there_are or f"must be one of {', '.join(known)}"
            field = "/mechanisms" if isinstance(value, str) else f"/mechanisms/{index}"
            raise FieldError(field, f"{words}, found {name!r}")
    return [name for name in known if name in names]


def bounded(field: str, value: object, largest: float = LARGEST) -> float:
    """Return a number of at most ``largest`` in absolute value."""
    found = number(field, value)
    if abs(found) > largest:
        raise FieldError(f"/{field}", f"must be at most {largest:g} in size; it is {found:g}")
    return found


def pair(field: str, value: object, largest: float = LARGEST, words: str = "[x, y]") -> complex:
    """Return two bounded numbers as a complex number."""
    numbers = () if isinstance(value, str) else sequence(value)
    if len(numbers) != 2:
        raise FieldError(f"/{field}", f"must be two numbers {words}")
    return complex(*(bounded(field, item, largest) for item in numbers))


def build(make: Callable[..., T], values: Fields, *positional: object) -> T:
    """Call ``make`` with arguments that it checks itself, or whose values were checked by name."""
    return make(*positional, **values)


def mapping(field: str, value: object) -> Fields:
    """Return a mapping; raise FieldError for anything else."""
    if not isinstance(value, Mapping):
        raise FieldError(f"/{field}", f"must be a mapping of fields; it is {value!r}")
    return value


def sequence(value: object) -> Sequence[object]:
    """Return the items of a list, tuple or array, empty for anything else."""
    if isinstance(value, np.ndarray):
        return list(value) if value.ndim else ()
    return value if isinstance(value, Sequence) and not isinstance(value, str) else ()


def box(field: str, value: object, flat: bool = False) -> tuple[float, float, float, float]:
    """Return [xmin, ymin, xmax, ymax] after a check; ``flat``: the box may have no width or no height."""
    found = np.zeros(0) if isinstance(value, str) else column(field, value)
    if (
        found.shape != (4,)
        or not np.all(np.abs(found) <= MAX_LENGTH)
        or not (np.all(found[:2] <= found[2:]) if flat else np.all(found[:2] < found[2:]))
    ):
        raise FieldError(f"/{field}", "must be [xmin, ymin, xmax, ymax] with xmin <= xmax and ymin <= ymax")
    left, low, right, high = found.tolist()
    return left, low, right, high


def whole_number(field: str, value: object, minimum: int, maximum: int) -> int:
    """Return a whole number within bounds."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not minimum <= value <= maximum:
        raise FieldError(f"/{field}", f"must be a whole number from {minimum} to {maximum:,}; it is {value!r}")
    return int(value)


def flag(field: str, value: object) -> bool:
    """Return True or False; None counts as False."""
    if not isinstance(value, (bool, type(None))):
        raise FieldError(f"/{field}", f"must be true or false; it is {value!r}")
    return bool(value)
