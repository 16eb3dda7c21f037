"""Records of a reply: frozen dataclasses and named tuples whose fields have a sentence each.

They are also the contract of the HTTP interface, whose description and JSON are generated from them. The annotation
``Annotated[type in Python, type in JSON]`` is for types that differ; an array without it is a list of numbers in JSON.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from itertools import pairwise
from math import isfinite
from typing import TYPE_CHECKING, Annotated, Any, Generic, TypeVar, cast, overload

import numpy as np
from numpy.typing import ArrayLike

from synthesis.arrays import Flags, Floats

if TYPE_CHECKING:
    from pandas import DataFrame

Item = TypeVar("Item")

Values = Annotated[Floats, list[float | None]]
"""(n,): null where a value is not finite."""
Vectors = Annotated[Floats, list[tuple[float, float] | None]]
"""(n, 2): null where a row is not finite."""

PYTHON_ONLY = {"python_only": True}
"""Metadata of a field that is not part of the HTTP interface."""
LAST = {"last": True}
"""Metadata of a field of a base that comes last in a reply."""


_SHOWN = 8
"""Largest number of items of a list or array that a printed record shows."""


class Record:
    """Base of dataclasses that are a reply or a part of it."""

    def __init_subclass__(cls) -> None:
        """Print the record by `Record.__repr__`, unless the class has its own."""
        if "__repr__" not in vars(cls):
            cls.__repr__ = Record.__repr__  # type: ignore[method-assign]

    def __repr__(self) -> str:
        """Return the fields, and only the sizes of long lists and arrays."""
        return _printed(self)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values under the names of the HTTP contract; None replaces a value that is not finite."""
        return dict(plain(self))


def _printed(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.size > _SHOWN:
        return f"<array of shape {value.shape}>"
    names = getattr(value, "_fields", None)
    if isinstance(value, Record) and is_dataclass(value):
        names = [column.name for column in fields(value) if column.repr]
    if names is not None:
        return f"{type(value).__name__}({', '.join(f'{name}={_printed(getattr(value, name))}' for name in names)})"
    if isinstance(value, list):
        return f"<list of {len(value)}>" if len(value) > _SHOWN else f"[{', '.join(map(_printed, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key!r}: {_printed(item)}' for key, item in value.items())}}}"
    return repr(value)


class Ranked(Sequence[Item], Generic[Item]):
    """Base of replies that are indexed, counted and iterated as the list of their results, best first; false without results."""

    @property
    def _results(self) -> Sequence[Item]:
        raise NotImplementedError

    @overload
    def __getitem__(self, index: int) -> Item: ...

    @overload
    def __getitem__(self, index: slice) -> list[Item]: ...

    def __getitem__(self, index: int | slice) -> Item | list[Item]:
        found = self._results[index]
        return list(cast("Sequence[Item]", found)) if isinstance(index, slice) else cast("Item", found)

    def __len__(self) -> int:
        return len(self._results)

    def to_dataframe(self) -> DataFrame:
        """Return a pandas table with a row for each result (extra ``pandas``).

        Numbers and words have a column each, named by their path in the result, such as ``errors.position_max``,
        ``mount.pivot_a.0`` and, for each sample, ``crank_angle.0``. Lists of more than four values inside of parts, such as
        curves, are left out.
        """
        from pandas import DataFrame

        return DataFrame([dict(_cells(plain(result))) for result in self])


def _cells(value: object, path: str = "") -> Iterator[tuple[str, object]]:
    """Yield the path and value of each number and word in plain values, without long lists inside of parts."""
    parts = value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, list) else None
    if parts is None:
        yield path, value
        return
    is_numbers = isinstance(value, list) and not any(isinstance(item, (Mapping, list)) for item in value)
    if isinstance(value, list) and len(value) > 4 and ("." in path or not is_numbers):
        return
    for name, part in parts:
        yield from _cells(part, f"{path}.{name}" if path else str(name))


@cache
def names_of(kind: Any) -> tuple[str, ...]:
    """Return the names of the fields of a record in a reply, in order; empty for types that are no record."""
    if is_dataclass(kind):
        shown = [field for field in fields(kind) if "python_only" not in field.metadata]
        return tuple(field.name for field in sorted(shown, key=lambda field: "last" in field.metadata))
    return getattr(kind, "_fields", ())


def field_sentences(kind: type) -> dict[str, str]:
    """Return the sentences below the fields of a record and of its bases, by the names of the fields."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        for statement, below in pairwise(_class_bodies(base.__module__).get(base.__name__, [])):
            if isinstance(statement, ast.AnnAssign) and isinstance(below, ast.Expr):
                found[ast.unparse(statement.target)] = " ".join(ast.literal_eval(below.value).split())
    return found


def parameter_sentences(function: object) -> dict[str, str]:
    """Return the descriptions of the parameters in the docstring of a function or class, by name."""
    section = inspect.cleandoc(function.__doc__ or "").partition("Parameters\n----------\n")[2]
    rows = re.findall(r"^([*\w, ]+) : .*\n((?:(?: {4}.*)?\n)+)", section, re.MULTILINE)
    return {name.strip(" *"): " ".join(text.split()) for names, text in rows for name in names.split(",")}


@cache
def _class_bodies(module: str) -> dict[str, list[ast.stmt]]:
    """Return the statements of each class of a module."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (OSError, TypeError):
        return {}
    return {statement.name: statement.body for statement in tree.body if isinstance(statement, ast.ClassDef)}


def describe_fields(kind: type) -> None:
    """Add the fields of a record with their sentences to its docstring, which `help` shows."""
    doc, sentences = kind.__doc__ or "", field_sentences(kind)
    if "Parameters\n" in doc or not names_of(kind):
        return
    rows = []
    for name, parameter in inspect.signature(kind).parameters.items():
        sentence = sentences.get(name) or name.replace("_", " ") + "."
        annotation = getattr(parameter.annotation, "__forward_arg__", parameter.annotation)
        rows.append(f"    {name} : {annotation}\n        {sentence[:1].upper()}{sentence[1:]}")
    text, heading, examples = doc.partition("    Examples\n")
    parts = [text.rstrip(), "\n".join(["    Parameters", "    ----------", *rows]), (heading + examples).rstrip()]
    kind.__doc__ = "\n\n".join(filter(None, parts)) + "\n    "


def plane(points: ArrayLike) -> Floats:
    """Return complex points of any shape as [x, y], (..., 2)."""
    points = np.asarray(points, dtype=complex)
    return np.stack([points.real, points.imag], axis=-1)


def xy(point: complex) -> tuple[float, float]:
    """Return a complex point as [x, y]."""
    return float(np.real(point)), float(np.imag(point))


def plain(value: object) -> Any:
    """Return a value as dicts, lists and numbers; None replaces a number, or a row of an array, that is not finite."""
    if isinstance(value, float):
        return float(value) if isfinite(value) else None
    if isinstance(value, np.ndarray):
        return _numbers(value)
    kind: Any = type(value)
    if names := names_of(kind):
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, Mapping):
        return {name: plain(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        # a list of numbers is plain: number by number it would take a second for a thousand curves
        return list(value) if value and type(value[0]) is float else [plain(part) for part in value]
    return value.item() if isinstance(value, np.generic) else value


def _numbers(values: Floats) -> list[object]:
    good: Flags = np.asarray(np.isfinite(values))
    if good.all():
        return values.tolist()
    if values.ndim < 2:
        return [value if fine else None for value, fine in zip(values.tolist(), good)]
    return [row if fine else None for row, fine in zip(values.tolist(), np.all(good, axis=-1).tolist())]
