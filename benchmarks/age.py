"""How old a figure is: the code that its measurement ran through, and what of that has changed since.

A benchmark depends on the definitions (functions, classes, constants of modules) that its ``measure`` reaches by names, from
module to module through their imports. What draws or words a result is not reached, nor is what the benchmark never calls.
A string that names a module of the tree (``-m app.start``, ``app.main:create_app``) or begins one (``f"app.scenes.{scene}"``)
counts as an import of it; of a package only where it is a program, since data are found by a package's name too. Of each
module a digest of the reached definitions is stored with the result, so that no history is needed to compare. Comments,
docstrings and layout are no change. Not looked at are data files, the versions of libraries, and what times and publishes
(``benchmarks/report.py``).
"""

from __future__ import annotations

import ast
import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

FOLDERS = ("app", "benchmarks", "data_build", "linkage_atlas", "synthesis", "tests")
PUBLISHING = ("benchmarks.report", "benchmarks.figures")
WHOLE, ALWAYS = "*", ""
"""In place of a definition's name: all of a module, and what its import executes beside definitions."""
MANY = 3
"""Of one folder, so many changed packages are named; of more, the folder."""
COMPARED = "--before"
"""A run with this option is one that later runs are held against: it stays as it is."""

Names = tuple[str, ...]
Definition = tuple[str, str]
"""Module and name."""


class Use(NamedTuple):
    """A dotted name in a definition, or a string that may name a module."""

    names: Names
    text: bool = False


def read(node: ast.AST, uses: list[Use], imports: dict[str, Names]) -> None:
    """Adds the dotted names of a node, each as long as it is, its strings, and what its imports bind names to."""
    chain, end = [], node
    while isinstance(end, ast.Attribute):
        chain.append(end.attr)
        end = end.value
    if isinstance(end, ast.Name):
        uses.append(Use((end.id, *reversed(chain))))
    elif isinstance(node, ast.Constant):
        if isinstance(node.value, str):
            uses.append(Use((node.value,), text=True))
    elif isinstance(node, ast.Import):
        for alias in node.names:
            first = alias.name.partition(".")[0]
            imports[alias.asname or first] = (alias.name if alias.asname else first,)
    elif isinstance(node, ast.ImportFrom):
        imports |= {alias.asname or alias.name: (str(node.module), alias.name) for alias in node.names}
    else:
        for name in node._fields:
            value = getattr(node, name, None)
            for child in value if isinstance(value, list) else (value,):
                if isinstance(child, ast.AST) and not is_words(child):
                    read(child, uses, imports)


def is_words(node: ast.AST) -> bool:
    """Whether a statement is a docstring, of a module, class or function or behind a value."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def plain(node: Any) -> str:
    """A syntax tree as text without docstrings and empty fields, alike for every version of Python."""
    if isinstance(node, ast.AST):
        parts = ((name, getattr(node, name, None)) for name in node._fields if name not in ("ctx", "kind"))
        return f"{type(node).__name__}({','.join(f'{name}={plain(value)}' for name, value in parts if value not in (None, []))})"
    if isinstance(node, list):
        return f"[{','.join(plain(one) for one in node if not is_words(one))}]"
    return repr(node)


@dataclass
class Module:
    """The definitions of a source file, what its names are bound to by imports, and what its import executes beside."""

    definitions: dict[str, list[ast.stmt]] = field(default_factory=dict)
    imports: dict[str, Names] = field(default_factory=dict)

    @classmethod
    def of(cls, path: Path) -> Module:
        found = cls()
        for node in ast.parse(path.read_text()).body:
            condition = ast.unparse(node.test) if isinstance(node, ast.If) else ""
            if isinstance(node, ast.Import | ast.ImportFrom) or condition == "TYPE_CHECKING":
                read(node, [], found.imports)
            elif not condition.startswith("__name__") and not is_words(node):
                for name in bound(node) or {ALWAYS}:
                    found.definitions.setdefault(name, []).append(node)
        return found


def bound(node: ast.stmt) -> set[str]:
    """Names that a statement of a module gives a value; those inside functions and classes are not the module's."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return {node.name}
    found = {node.id} if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) else set()
    return found.union(*(bound(child) for child in ast.iter_child_nodes(node)))


class Code:
    """The source of a tree, read as far as it is asked for."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self._modules: dict[str, Module] = {}
        self._edges: dict[Definition, set[Definition]] = {}
        self._texts: dict[Definition, str] = {}
        self._digests: dict[str, dict[str, str]] = {}

    @cached_property
    def paths(self) -> dict[str, Path]:
        """Source files by the dotted names of their modules."""
        every = (path for folder in FOLDERS for path in (self.root / folder).rglob("*.py"))
        return {".".join(p.relative_to(self.root).with_suffix("").parts).removesuffix(".__init__"): p for p in every}

    def module(self, name: str) -> Module:
        if name not in self._modules:
            self._modules[name] = Module.of(self.paths[name])
        return self._modules[name]

    def resolve(self, names: Names) -> Definition | None:
        """The definition that a module and names in it lead to, through what other modules import; None outside of the tree."""
        module, *rest = names
        while rest and f"{module}.{rest[0]}" in self.paths:
            module = f"{module}.{rest.pop(0)}"
        if module not in self.paths:
            return None
        if not rest:
            return module, WHOLE
        known = self.module(module)
        if rest[0] in known.imports and rest[0] not in known.definitions:
            return self.resolve((*known.imports[rest[0]], *rest[1:]))
        return (module, rest[0]) if rest[0] in known.definitions else None

    def named(self, text: str) -> Iterator[Definition]:
        """The module that a string names, the program of a package, or all modules whose names it begins."""
        if re.fullmatch(r"\w+(\.\w+)*(:\w+)?", text) and (module := text.partition(":")[0]) in self.paths:
            if self.paths[module].name != "__init__.py":
                yield module, WHOLE
            elif f"{module}.__main__" in self.paths:
                yield f"{module}.__main__", WHOLE
        elif re.fullmatch(r"\w+(\.\w+)*\.", text):
            yield from ((name, WHOLE) for name in self.paths if name.startswith(text))

    def edges(self, one: Definition) -> set[Definition]:
        """The definitions that one uses, and what the import of its module executes."""
        if one not in self._edges:
            module, name = one
            if module in PUBLISHING:
                return set()
            known, found = self.module(module), {(module, ALWAYS)} - {one}
            if name == WHOLE:
                found |= {(module, other) for other in known.definitions}
            for node in known.definitions.get(name, ()):
                uses: list[Use] = []
                inside: dict[str, Names] = {}
                read(node, uses, inside)
                for use in uses:
                    if use.text:
                        found |= set(self.named(use.names[0]))
                    elif use.names[0] in inside:
                        found.add(self.resolve((*inside[use.names[0]], *use.names[1:])) or one)
                    else:
                        found.add(self.resolve((module, *use.names)) or one)
            if (above := module.rpartition(".")[0]) in self.paths:
                found.add((above, ALWAYS))
            self._edges[one] = found
        return self._edges[one]

    def reached(self, start: Definition) -> set[Definition]:
        """All definitions that one leads to, itself included."""
        found, ahead = {start}, [start]
        while ahead:
            new = self.edges(ahead.pop()) - found
            found |= new
            ahead += new
        found = {one for one in found if one[0] not in PUBLISHING}
        return {(module, name) for module, name in found if name in self.module(module).definitions}

    def digests(self, benchmark: str) -> dict[str, str]:
        """The modules that a benchmark's ``measure`` runs through, each with a digest of what it reaches there."""
        if benchmark not in self._digests:
            texts: dict[str, list[str]] = {}
            for one in sorted(self.reached((f"benchmarks.{benchmark}", "measure"))):
                if one not in self._texts:
                    self._texts[one] = one[1] + plain(self.module(one[0]).definitions[one[1]])
                texts.setdefault(one[0], []).append(self._texts[one])
            self._digests[benchmark] = {
                module: hashlib.sha256("\n".join(text).encode()).hexdigest()[:8] for module, text in texts.items()
            }
        return self._digests[benchmark]


def package(module: str) -> str:
    """What is named of a changed module: its package, two names deep, or the module itself where it lies on a folder."""
    return ".".join(module.split(".")[:2])


def changed(then: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """The packages in which two runs of a benchmark go through different code."""
    return folded(package(name) for name in then.keys() | now.keys() if then.get(name) != now.get(name))


def folded(names: Iterable[str]) -> list[str]:
    """Packages, sorted; where many are of one folder, the folder instead."""
    folders: dict[str, list[str]] = {}
    for name in sorted(set(names)):
        folders.setdefault(name.partition(".")[0], []).append(name)
    whole = {folder for folder, some in folders.items() if folder in some or len(some) > MANY}
    return [name for folder, some in folders.items() for name in ([folder] if folder in whole else some)]


def stamps(results: Any) -> list[dict[str, Any]]:
    """Every stamp of a result, wherever it stands."""
    if isinstance(results, dict):
        if {"commit", "command"} <= results.keys():
            return [results]
        results = [value for name, value in results.items() if name not in ("code", "took")]
    return [one for part in results for one in stamps(part)] if isinstance(results, list) else []


def since(stamp: Mapping[str, Any], benchmark: str, results: Mapping[str, Any], code: Code) -> list[str] | None:
    """The packages that have changed since a run, none where others are held against it; None where that is not known."""
    if COMPARED in stamp["command"]:
        return []
    then = results.get("code", {}).get(stamp["commit"])
    return None if then is None else changed(then, code.digests(benchmark))


def told(some: Sequence[list[str] | None]) -> str:
    """In words what has changed since some runs, or nothing."""
    names = [f"`{name}`" for name in folded(name for one in some for name in one or ())]
    oldest = "the oldest " if len(some) > 1 else ""
    listed = " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))
    unknown = "what has changed since is not known" + (" of all" if len(some) > 1 else "")
    parts = ([f"{oldest}before the change of {listed}"] if names else []) + ([unknown] if None in some else [])
    return "; ".join(parts)
