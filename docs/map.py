"""``python -m docs.map`` (``make map``): the packages by floor and what each imports; fails on an arrow up or a circle."""

from __future__ import annotations

import ast
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[1]
FLOORS = ("app", "linkage_atlas", "data_build", "synthesis")
"""From the top down: a module imports from its own floor and from those below it."""


def name_of(path: Path) -> str:
    """Dotted name of a source file; of a package's ``__init__.py``, the package."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def sources(*folders: str) -> list[Path]:
    """Source files of some folders, sorted."""
    return [path for folder in folders for path in sorted((ROOT / folder).rglob("*.py"))]


def imported(path: Path) -> set[str]:
    """Dotted names of all modules that a file imports, also inside functions; a relative import is an error."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            if node.level or not node.module:
                raise ValueError(f"{path}: relative import")
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names


def module_graph() -> dict[str, set[str]]:
    """Each module of the floors with the modules of the floors that it imports."""
    paths = {name_of(path): path for path in sources(*FLOORS)}
    return {name: {one for one in imported(path) if one in paths} - {name} for name, path in paths.items()}


def package_of(module: str, packages: set[str]) -> str:
    """The package that a module lies in; a module beside the packages of a floor belongs to the floor itself."""
    return module if module in packages else module.rpartition(".")[0]


def package_graph() -> dict[str, set[str]]:
    """Each package with the packages that its modules import, one level deep; an empty ``__init__.py`` is no import."""
    packages = {name_of(path) for path in sources(*FLOORS) if path.name == "__init__.py"}
    graph: dict[str, set[str]] = {package: set() for package in sorted(packages)}
    for module, others in module_graph().items():
        own = package_of(module, packages)
        graph[own] |= {package_of(other, packages) for other in others if other not in packages} - {own}
        graph[own] |= {other for other in others if other in packages and other in FLOORS[:2]} - {own}
    return graph


def faults() -> list[str]:
    """What breaks the order of the floors: arrows up, and circles of modules or packages."""
    found = []
    graph = module_graph()
    for module, others in graph.items():
        floor = FLOORS.index(module.partition(".")[0])
        found += [f"{module} imports {other}: up" for other in others if FLOORS.index(other.partition(".")[0]) < floor]
    for what, arrows in (("modules", graph), ("packages", package_graph())):
        try:
            TopologicalSorter(arrows).prepare()
        except CycleError as error:
            found.append(f"a circle of {what}: {' -> '.join(error.args[1])}")
    return found


def main() -> int:
    """Print the map and the faults; 1 where there is one."""
    graph = package_graph()
    for floor in FLOORS:
        for package in [name for name in graph if name.partition(".")[0] == floor]:
            print(f"{'  ' * package.count('.')}{package:<{28 - 2 * package.count('.')}} -> "
                  f"{', '.join(sorted(graph[package])) or 'nothing of these'}")
        print()
    print("\n".join(faults()) or "no arrow up, no circle")
    return 1 if faults() else 0


if __name__ == "__main__":
    sys.exit(main())
