"""Errors of the domain. They do not depend on a web framework or on a command line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import Any

_LONGEST_NAME = 40
_SAME_NAME = 0.9
"""Similarity above which the name of a field of another object is suggested."""


def field_in_words(field: str) -> str:
    """Return a JSON pointer as people read it: names joined by points, items of lists counted from 1.

    >>> field_in_words("/limits/pivot_box"), field_in_words("/position/2/0")
    ('limits.pivot_box', 'position, sample 3, x')
    """
    words, names = "", field.lstrip("/").split("/")
    for k, name in enumerate(names):
        last = names[k - 1] if k else ""
        if name.isdecimal() and k:
            axis = names[k - 2] == "position" and last.isdecimal() and int(name) < 2
            words += f", {'xy'[int(name)]}" if axis else f", {_ITEMS.get(last, 'item')} {int(name) + 1}"
        else:
            words += f"{', ' if last.isdecimal() else '.' if k else ''}{name}"
    return words or "request"


_ITEMS = {
    **dict.fromkeys(("rotation", "position", "crank_angle", "travel", "output", "input", "weights"), "sample"),
    "table": "row",
    "catalogue": "row",
}
"""Names of the items of lists."""


class FieldError(ValueError):
    """Invalid input: the field, the fault, and its amount.

    Parameters
    ----------
    field : str
        JSON pointer into the request, for example ``/limits/pivot_box``; the empty string is the whole request.
    message : str
        Sentence for the user: what was found and what is allowed.
    **details
        Further facts as plain JSON values, for example ``constraint="closure", amount=12.5``.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> try:
    ...     la.synthesize([0, 12, 27], crank_span=5000)
    ... except la.FieldError as error:
    ...     print(error.field)
    /crank_span
    """

    def __init__(self, field: str, message: str, **details: Any) -> None:
        super().__init__(f"{field_in_words(field)}: {message}")
        self.field = field
        self.message = message
        self.details = details

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the parts, so that the error passes unchanged between processes."""
        return _field_error, (type(self), self.field, self.message, self.details)

    @classmethod
    def no_such(
        cls,
        where: str,
        name: str,
        known: Sequence[str],
        what: str = "field",
        elsewhere: Mapping[str, str] | None = None,
    ) -> FieldError:
        """Return the error of an unknown name, with similar names, or else all known names.

        Parameters
        ----------
        where : str
            JSON pointer to the object that has the name.
        name : str
            The unknown name.
        known : sequence of str
            Names that the object may have.
        what : str
            Kind of the name, for the sentence.
        elsewhere : mapping of str to str, optional
            Paths of the names in all objects; the path of an almost equal name is given if `known` has none that is closer.
        """
        from difflib import get_close_matches  # imported here because valid requests do not need it

        short, elsewhere = str(name)[:_LONGEST_NAME], elsewhere or {}
        nearest = next(iter(get_close_matches(short, [*known, *elsewhere], 1, _SAME_NAME)), None)
        matches = [elsewhere[nearest]] if nearest and nearest not in known else get_close_matches(short, known)
        hint = f"near: {', '.join(matches)}" if matches else f"there are {', '.join(known)}"
        return cls(f"{where}/{name}", f"there is no {what} {short!r}; {hint}")


def _field_error(kind: type[FieldError], field: str, message: str, details: dict[str, Any]) -> FieldError:
    return kind(field, message, **details)


class AtlasFault(StrEnum):
    """Reason to refuse an atlas file; the value is the sentence for the user.

    Examples
    --------
    >>> AtlasFault.SCHEMA.value
    'the file is not an atlas of a schema that this version reads'
    """

    MISSING = "there is no atlas file at this path"
    CHECKSUM = "the file's bytes do not match its checksum: it is damaged or cut off"
    SCHEMA = "the file is not an atlas of a schema that this version reads"
    CONTENT = "the file's arrays contradict its own description"
    NOT_WANTED = "the program was started without an atlas"
    LIMIT = "the atlas is larger than this service may load"


class AtlasError(Exception):
    """Error of an atlas file that must not be used.

    Parameters
    ----------
    fault : AtlasFault
        The kind of fault.
    detail : str
        The observation, in words.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> try:
    ...     la.load_atlas("nowhere.h5")
    ... except la.AtlasError as error:
    ...     print(error.fault.name, error.detail)
    MISSING nowhere.h5 does not exist
    """

    def __init__(self, fault: AtlasFault, detail: str) -> None:
        super().__init__(f"{fault.value} ({detail})")
        self.fault = fault
        self.detail = detail

    def __reduce__(self) -> tuple[type[AtlasError], tuple[AtlasFault, str]]:
        """Pickle the parts, so that the error passes unchanged between processes."""
        return AtlasError, (self.fault, self.detail)
