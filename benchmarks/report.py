"""Times, tables, results and their places in the documents, for all benchmarks.

**A benchmark** is a module ``benchmarks/NAME.py`` with three functions. `run` calls the first for ``python -m benchmarks.NAME``;
the other two use the content of the result file and measure nothing:

    def measure(cases: Annotated[int, "of each class"] = 30) -> Iterator[dict]   # the parameters are its options
    def blocks(results) -> dict[str, str]   # the text of each of its markers, by name
    def draw(results) -> None               # optional: its pictures, with `figures.figure`

The results that ``measure`` yields are published: `save` writes ``benchmarks/results/NAME.json``, stamped with machine, commit
and command, and `render` draws the pictures and fills the documents. A long benchmark yields its results after each part. A tree
with uncommitted changes publishes nothing: there the option ``--try`` prints the blocks instead.

**A marker** is the pair ``<!-- NAME.BLOCK -->`` and ``<!-- /NAME.BLOCK -->`` in README.md, or in
`docs` and its folders `background` and `howto`. If a line ends after the
first marker, the text between the markers is a block of lines (a table), otherwise a few words of the line. Every block occurs at
least once; the block ``made`` (machine, commit and command in words) is generated automatically.

**Update without measuring**: ``python -m benchmarks.report [NAME ...]`` draws the pictures and fills all markers from the
committed JSON files; ``tests/benchmarks/test_report.py`` compares the documents with them. When code changes that affects a
figure, run its command again, since its age is not checked.

Example::

    times = repeat(work, runs=9)                         # Times: times.median.wall, times.minimum.processor (seconds)
    result = times.run(work, argument)                   # a further run, and its result
    ours, theirs = paired([ours, theirs], rounds=9)      # in alternating order
    ratio(theirs, ours)["median"]                        # of the pairs: min, median, p99, max
    tables(NAME, {"spans": rows})                        # in the form given in tables.toml: "ms: {ms:significant}"
"""

from __future__ import annotations

import argparse
import importlib
import inspect
import json
import math
import os
import platform
import re
import shlex
import string
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, get_args, get_type_hints

import numpy as np

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "results"
DOCUMENTS = [
    ROOT / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *(path for shelf in ("background", "howto") for path in sorted((ROOT / "docs" / shelf).glob("*.md"))),
]


class Seconds(NamedTuple):
    """Time on the clock, and of the processor in this process (all its threads), which other work does not stretch."""

    wall: float
    processor: float


@dataclass
class Times:
    """Seconds of several runs of the same work."""

    wall: list[float] = field(default_factory=list)
    processor: list[float] = field(default_factory=list)

    def run(self, function: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        """Run the work again, record its time and return its result."""
        wall, processor = time.perf_counter(), time.process_time()
        result = function(*arguments, **options)
        self.processor.append(time.process_time() - processor)
        self.wall.append(time.perf_counter() - wall)
        return result

    def percentile(self, percent: float) -> Seconds:
        """Percentile of each clock, interpolated."""
        return Seconds(*(float(np.percentile(seconds, percent)) for seconds in (self.wall, self.processor)))

    @property
    def minimum(self) -> Seconds:
        return self.percentile(0)

    @property
    def median(self) -> Seconds:
        return self.percentile(50)

    def summary(self) -> dict[str, float]:
        """Median and 99th percentile of both clocks in milliseconds, as the result files hold them."""
        return {
            f"{name}{clock}_ms": 1000 * getattr(self.percentile(percent), which)
            for clock, which in (("", "wall"), ("_processor", "processor"))
            for name, percent in (("median", 50), ("p99", 99))
        }


def repeat(function: Callable[[], Any], runs: int = 5, warm_up: int = 1) -> Times:
    """Times of several runs, after some that are not counted."""
    times = Times()
    for _ in range(warm_up):
        function()
    for _ in range(runs):
        times.run(function)
    return times


def in_turn(items: Iterable[Any], rounds: int) -> Iterator[Any]:
    """All in each round, every other round in reverse, so that a drift meets all alike."""
    items = list(items)
    for number in range(rounds):
        yield from items[:: -1 if number % 2 else 1]


def paired(functions: Sequence[Callable[[], Any]], rounds: int = 5, warm_up: int = 1) -> list[Times]:
    """Times of things to compare, `in_turn`."""
    times = [repeat(function, 0, warm_up) for function in functions]
    for clock, function in in_turn(zip(times, functions), rounds):
        clock.run(function)
    return times


def spread(values: Sequence[float]) -> dict[str, float]:
    """Least, median, 99th percentile and largest, to five digits."""
    quantiles = np.quantile(values, [0, 0.5, 0.99, 1])
    return {name: float(f"{value:.5g}") for name, value in zip(("min", "median", "p99", "max"), quantiles)}


def ratio(times: Times, to: Times, clock: str = "processor") -> dict[str, float]:
    """`spread` of the ratios of `paired` runs."""
    return spread([a / b for a, b in zip(getattr(times, clock), getattr(to, clock))])


def lines(head: Sequence[str], rows: Sequence[Sequence[str]], text_columns: int = 1) -> str:
    """Return a Markdown table of given cells; the columns after the text columns are numbers, aligned to the right."""
    rule = ["---"] * text_columns + ["--:"] * (len(head) - text_columns)
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, rule, *rows))


def significant(value: float | None, digits: int = 3) -> str:
    """Format a number with a given number of digits, without powers of ten: 0.0123, 1.23, 12,300; a dash for a missing value."""
    if value is None or not math.isfinite(value):
        return "-"
    if value == 0:
        return "0"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    return f"{round(value, decimals):,.{max(decimals, 0)}f}"


def finite(value: float) -> float | None:
    """Return a number for a result file: None if it is not finite."""
    return float(value) if math.isfinite(value) else None


def power(value: float | None) -> str:
    """A number to two digits with its power of ten."""
    return "no answer" if value is None or not math.isfinite(value) else f"{value:.1e}"


def size(value: float | None) -> str:
    """Bytes as kB, MB, GB or TB."""
    if value is None or not math.isfinite(value):
        return "-"
    units = ((1e12, "TB"), (1e9, "GB"), (1e6, "MB"), (1e3, "kB"))
    unit, name = next((u, n) for u, n in units if value >= u or n == "kB")
    return f"{significant(value / unit)} {name}"


def duration(seconds: float) -> str:
    """Seconds as ms, s, minutes or hours."""
    units = ((7200, 3600, "hours"), (120, 60, "minutes"), (1, 1, "s"), (0, 1e-3, "ms"))
    unit, name = next((unit, name) for smallest, unit, name in units if not seconds < smallest)
    return f"{significant(seconds / unit)} {name}"


def percent(share: float, digits: int = 2) -> str:
    """A share in percent."""
    return f"{significant(100 * share, digits)} %"


def ms(seconds: float) -> str:
    """Seconds as milliseconds, without their unit."""
    return f"{1000 * seconds:,.1f}"


def ends(values: Iterable[float], digits: int = 1) -> str:
    """The least and the largest of some numbers."""
    return "{:.{}f} to {:.{}f}".format(min(values), digits, max(values), digits)


class Words(string.Formatter):
    """Formats in which the functions above are specifications too: ``{ms:significant}``, ``{share:percent 3}``."""

    functions: ClassVar = {
        function.__name__: function for function in (significant, power, size, duration, percent, ms)
    }

    def format_field(self, value: Any, spec: str) -> str:
        name, _, digits = spec.partition(" ")
        say = self.functions.get(name)
        return say(value, *map(int, digits.split())) if say else super().format_field(value, spec)


TABLES = tomllib.loads((ROOT / "benchmarks" / "tables.toml").read_text())
"""Arguments of `table` by result and block."""


def tables(result: str, rows: Mapping[str, Any]) -> dict[str, str]:
    """The blocks of a result that are tables in ``tables.toml``, from the rows of each."""
    return {block: table(rows[block], **how) for block, how in TABLES[result].items()}


def table(rows: Sequence[Mapping[str, Any]], columns: str, text_columns: int = 1) -> str:
    """Return a Markdown table of mappings.

    Parameters
    ----------
    rows : sequence of mapping
    columns : str
        A line for each column with heading and cell, ``worst J: {J:power}``; the cell is a format of `Words`.
    text_columns : int
        Number of text columns on the left; the other columns are numbers.
    """
    heads, _, cells = zip(*(column.rpartition(": ") for column in columns.splitlines()))
    return lines(heads, [[Words().vformat(cell, (), row) for cell in cells] for row in rows], text_columns)


def machine() -> dict[str, Any]:
    """Return the properties that affect times: processor, cores, memory, Python and numpy."""
    cpu_info = Path("/proc/cpuinfo")
    model = re.search(r"^model name\s*:\s*(.*)$", cpu_info.read_text() if cpu_info.exists() else "", re.MULTILINE)
    return {
        "processor": model[1] if model else platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "memory_bytes": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"),
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def commit() -> str:
    """The commit of the source tree, with "+changes" where its code differs; "unknown" outside of a repository."""

    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()

    try:
        # what a benchmark itself writes is no change of the code
        own = (":!docs", ":!*.md", ":!benchmarks/results")
        changed = git("status", "--porcelain", "--", ".", *own)
        return git("rev-parse", "HEAD") + ("+changes" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def command() -> str:
    """Return the command of this process, without the folders of absolute paths."""
    words = [Path(word).name if word.startswith("/") else word for word in sys.orig_argv[1:]]
    threads = os.environ.get("OMP_NUM_THREADS")
    return (f"OMP_NUM_THREADS={threads} " if threads else "") + shlex.join(["python", *words])


def stamp() -> dict[str, Any]:
    """Return the origin of results: machine, commit, command."""
    return {"machine": machine(), "commit": commit(), "command": command()}


def stamps(results: Any) -> list[dict[str, Any]]:
    """Return every stamp in a result, at any depth."""
    if isinstance(results, dict):
        if {"commit", "command"} <= results.keys():
            return [results]
        results = list(results.values())
    return [found for part in results for found in stamps(part)] if isinstance(results, list) else []


def save(results: Mapping[str, Any], name: str) -> None:
    """Write ``benchmarks/results/NAME.json``: the results, and under ``made`` the `stamp` if they have none."""

    def plain(value: Any) -> Any:
        return value.tolist()  # numpy's numbers and arrays

    text = json.dumps({"made": stamp(), **results}, indent=1, allow_nan=False, default=plain, ensure_ascii=False)
    innermost = re.compile(r"\[\n[^\[\]{}]*?\n\s*\]")  # a list of numbers or words is written in a single line
    text = innermost.sub(lambda found: re.sub(r"\s*\n\s*", " ", found[0]).replace("[ ", "[").replace(" ]", "]"), text)
    RESULTS.mkdir(parents=True, exist_ok=True)
    (RESULTS / f"{name}.json").write_text(text + "\n")


def made_text(stamps: Sequence[Mapping[str, Any]]) -> str:
    """Describe where numbers come from: each machine, commit and command once, and of more than two runs only the commits."""
    words = {"processor": lambda name: re.sub(r"\(R\)| Processor", "", name), "cores": "{} cores".format}
    machines = dict.fromkeys(
        ", ".join(say(entry["machine"][name]) for name, say in words.items() if name in entry["machine"])
        for entry in stamps
    )
    runs: dict[str, None] = {}
    for entry in stamps:
        found = re.sub("(?<=^[0-9a-f]{9})[0-9a-f]*", "", entry["commit"])
        shown = re.sub("(?<=')(?: '[^']*')+ ('[^']*')", r" ... \1", entry["command"])  # long lists by their ends
        shown = shown.removeprefix("OMP_NUM_THREADS=1 ")
        runs[f"`{shown}` at commit {found}"] = None
    if len(runs) > 2:
        modules = dict.fromkeys(re.findall(r"benchmarks\.\w+", " ".join(runs)))
        commits = dict.fromkeys(run.rpartition(" ")[2] for run in runs)
        said = f"{len(runs)} runs of {', '.join(f'`python -m {name}`' for name in modules)} at commits {', '.join(commits)}"
    else:
        said = ", ".join(runs)
    return f"Measured by {said}; {'; '.join(machines)}."


def load(name: str) -> Any:
    """Return the stored results of a benchmark."""
    return json.loads((RESULTS / f"{name}.json").read_text())


def names() -> list[str]:
    """All results; ``NAME_reference.json`` is no result, but what a benchmark holds its own against."""
    return sorted(path.stem for path in RESULTS.glob("*.json") if not path.stem.endswith("_reference"))


def known(name: str) -> dict[str, Any]:
    """Return stored results for a benchmark that measures only a part; empty if none are stored."""
    return load(name) if (RESULTS / f"{name}.json").exists() else {}


MARKER = re.compile(r"<!-- (\w+)\.(\w+) -->(\n?)(.*?)\n?<!-- /\1\.\2 -->", re.DOTALL)


def fill(text: str, parts: Mapping[str, Mapping[str, str]]) -> str:
    """A document whose markers hold the given blocks, by result and name; markers of other results stay as they are.

    Raises
    ------
    ValueError
        A marker has no block of its name, or no end.
    """

    def filled(found: re.Match[str]) -> str:
        name, block, line_end, _ = found.groups()
        if name not in parts:
            return found[0]
        if block not in parts[name]:
            raise ValueError(f"no block {name}.{block}: benchmarks/{name}.py has {', '.join(parts[name])}")
        return f"<!-- {name}.{block} -->{line_end}{parts[name][block]}{line_end}<!-- /{name}.{block} -->"

    if single := re.search(r"<!-- /?(\w+\.\w+) -->", MARKER.sub("", text)):
        raise ValueError(f"the marker {single[1]} stands alone")
    return MARKER.sub(filled, text)


def parts(name: str) -> dict[str, str]:
    """Return the text of every block of a result."""
    results = load(name)
    module = importlib.import_module(f"benchmarks.{name}")
    return {"made": made_text([results["made"]]), **module.blocks(results)}


def render(chosen: Sequence[str] | None = None, pictures: bool = True) -> None:
    """Draw the pictures and fill the markers of some results, or of all, from their files."""
    chosen = names() if chosen is None else chosen
    for name in chosen:
        module = importlib.import_module(f"benchmarks.{name}")
        if pictures and hasattr(module, "draw"):
            module.draw(load(name))
    found = {name: parts(name) for name in chosen}
    for path in DOCUMENTS:
        path.write_text(fill(path.read_text(), found))


def run(measure: Callable[..., Iterator[Mapping[str, Any]]], arguments: Sequence[str] | None = None) -> None:
    """Measure with the options of the command line, and `save` and `render` all that comes.

    An option is a parameter of ``measure`` with its default: ``Annotated[type, help]``, or ``Annotated[type, help, choices]``;
    of a tuple, several values; of a bool, a flag.
    """
    name = Path(inspect.getfile(measure)).stem
    words = sys.modules[measure.__module__].__doc__
    parser = argparse.ArgumentParser(description=words, formatter_class=argparse.RawDescriptionHelpFormatter)
    hints = get_type_hints(measure, include_extras=True)
    for option, parameter in inspect.signature(measure).parameters.items():
        kind, words, *choices = get_args(hints[option])
        kind = next(iter(get_args(kind)), kind)  # of "Path | None": the Path
        several = {"nargs": "+"} if isinstance(parameter.default, tuple) else {}
        several |= {"choices": choices[0]} if choices else {}
        flag, words = f"--{option.replace('_', '-')}", f"{words} (%(default)s)"
        if kind is bool:
            parser.add_argument(flag, action="store_true", help=words)
            continue
        parser.add_argument(flag, type=kind, default=parameter.default, help=words, **several)
    parser.add_argument("--try", action="store_true", dest="trial", help="print the blocks and publish nothing")
    options = vars(parser.parse_args(arguments))
    trial = options.pop("trial")
    if not trial and commit().endswith("+changes"):
        parser.exit(1, "the tree has changes that are not committed: commit them, or measure with --try\n")
    code_stamp = stamp()  # of the code as it is read now, whatever is committed meanwhile
    short: SystemExit | None = None

    def measured() -> Iterator[Mapping[str, Any]]:
        nonlocal short
        try:
            yield from measure(**options)
        except SystemExit as error:  # all was measured, and some of it is not as it should be
            short = error

    for results in measured():
        results = {"made": code_stamp, **results}
        if trial:
            blocks = importlib.import_module(f"benchmarks.{name}").blocks(results)
            print(*(f"{block}:\n{text}\n" for block, text in blocks.items()), sep="\n")
            continue
        save(results, name)
        render([name])
    if short:
        raise short


def main(arguments: Sequence[str] | None = None) -> None:
    """Render from the committed results."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("names", nargs="*", help="results, without .json; all if none is named")
    render(parser.parse_args(arguments).names or None)


if __name__ == "__main__":
    main()
