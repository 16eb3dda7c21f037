"""``python -m docs.map`` (``make map``): the packages by floor and what each imports; fails on an arrow up or a circle."""

from __future__ import annotations

import ast
import sys
import textwrap
from functools import cache
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


@cache
def imported(path: Path) -> frozenset[str]:
    """Dotted names of all modules that a file imports, also inside functions; a relative import is an error."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            if node.level or not node.module:
                raise ValueError(f"{path}: relative import")
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return frozenset(names)


def module_graph() -> dict[str, set[str]]:
    """Each module of the floors with the modules of the floors that it imports."""
    paths = {name_of(path): path for path in sources(*FLOORS)}
    return {
        name: {dependency for dependency in imported(path) if dependency in paths} - {name}
        for name, path in paths.items()
    }


def package_graph() -> dict[str, set[str]]:
    """Return each package with the packages that its modules import; a module directly on a floor represents itself."""
    graph: dict[str, set[str]] = {}
    for module, dependencies in module_graph().items():
        graph.setdefault(_home(module), set()).update(map(_home, dependencies))
    return {home: dependencies - {home} for home, dependencies in graph.items()}


def _home(module: str) -> str:
    """The package of a module, two names deep: synthesis.atlas of synthesis.atlas.scan, synthesis.pose of itself."""
    return ".".join(module.split(".")[:2])


def faults() -> list[str]:
    """Return violations of the order of the floors: upward imports, and cycles of modules or packages."""
    found = []
    graph = module_graph()
    for module, dependencies in graph.items():
        floor = FLOORS.index(module.partition(".")[0])
        found += [
            f"{module} imports {dependency}: up"
            for dependency in dependencies
            if FLOORS.index(dependency.partition(".")[0]) < floor
        ]
    for what, arrows in (("modules", graph), ("packages", package_graph())):
        try:
            TopologicalSorter(arrows).prepare()
        except CycleError as error:
            found.append(f"a circle of {what}: {' -> '.join(error.args[1])}")
    return found


def picture() -> str:
    """Draw the map as text: floors from the top down, packages with their imports; one-module packages in a line."""
    graph, lines = package_graph(), []
    for floor in FLOORS:
        homes = sorted(home for home in graph if home.partition(".")[0] == floor)
        packages = [home for home in homes if _is_package(home)]
        modules = [home for home in homes if home not in packages]
        below = sorted({dependency.partition(".")[0] for home in modules for dependency in graph[home]} - {floor})
        lines.append(f"{floor}{' -> ' + ', '.join(below) if below else ''}")
        lines += textwrap.wrap(
            ", ".join(home.partition(".")[2] for home in modules if home != floor),
            100,
            initial_indent="    ",
            subsequent_indent="    ",
        )
        for package in packages:
            targets = graph[package]
            arrows = {name if _is_package(name) else f"{name.partition('.')[0]}.*" for name in targets}
            lines.append(f"    {package.partition('.')[2] + '/':<10} -> {', '.join(sorted(arrows)) or 'nothing'}")
        lines.append("")
    return "\n".join(lines)


def _is_package(home: str) -> bool:
    return "." in home and (ROOT / home.replace(".", "/")).is_dir()


def main() -> int:
    """Print the map and the faults; return 1 if there is a fault."""
    print(picture())
    print("\n".join(faults()) or "no arrow up, no circle")
    return 1 if faults() else 0


if __name__ == "__main__":
    sys.exit(main())
