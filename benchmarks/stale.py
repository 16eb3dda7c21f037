"""``python -m benchmarks.stale`` (``make figures``): measures again what was measured with other code than that of this tree.

It lists the commands with what has changed since and how long each took, and runs them in turn: first those that measure
processor time or count, so that another such run may share the machine, then those that need it alone; of each the short ones
first. What has ended counts as measured, so the same command goes on where it stopped. A tree with changes that are not
committed is refused.
"""

from __future__ import annotations

import argparse
import importlib
import inspect
import os
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from benchmarks import age, report

ABOUT = {
    "acceptance": 1800,
    "engine": 2700,
    "everyday": 1800,
    "free_timing": 900,
    "function": 1800,
    "limited": 1800,
    "solids": 60,
    "stability": 60,
}
"""Seconds of a whole run, as `make help` says, where no run has been timed yet."""


ALONE = ("everyday", "growth", "index", "many_requests", "retrieval", "sliders", "throughput")
"""Benchmarks that measure by the clock, or with all cores."""
ALONE_PARTS = ("budgets", "crowds", "reloads")
"""Such parts of `benchmarks.reliability`."""


class Run(NamedTuple):
    """A command whose figures are old."""

    name: str
    command: str
    since: str
    took: float | None
    """Seconds of its last run."""

    @property
    def expected(self) -> float | None:
        """Seconds that it will take, None where nothing tells."""
        return self.took or ABOUT.get(self.name)

    @property
    def alone(self) -> bool:
        """Whether nothing else may run meanwhile."""
        some = self.name == "reliability" and (
            "--parts" not in self.command or set(ALONE_PARTS) & set(self.command.split())
        )
        return self.name in ALONE or bool(some)


def stale(code: age.Code = report.CODE) -> list[Run]:
    """The commands to run again: those that can share the machine first; the shortest first, of unknown length at the end."""
    found = {}
    for name in report.names():
        results = report.load(name)
        for stamp in age.stamps(results):
            why, command = age.since(stamp, name, results, code), stamp["command"]
            if why != [] and f"-m benchmarks.{name}" in command:
                found.setdefault(
                    (name, command), Run(name, command, age.told([why]), results.get("took", {}).get(command))
                )
    return sorted(found.values(), key=lambda one: (one.alone, one.expected is None, one.expected or 0.0))


def words(run: Run) -> list[str]:
    """The command as it is started today: without options that the benchmark no longer has, and files that are not there."""
    known = inspect.signature(importlib.import_module(f"benchmarks.{run.name}").measure).parameters
    _, _, options = run.command.partition(f"-m benchmarks.{run.name}")
    groups: list[list[str]] = []
    for word in shlex.split(options):
        if word.startswith("--"):
            groups.append([word])
        else:
            groups[-1].append(word)
    kept = (
        group
        for group in groups
        if group[0][2:].replace("-", "_") in known
        and all(Path(word).exists() for word in group[1:] if word.endswith(".h5"))
    )
    return [sys.executable, "-m", f"benchmarks.{run.name}", *(word for group in kept for word in group)]


def told(runs: list[Run]) -> Iterator[str]:
    """The list in words."""
    for run in runs:
        time = f"{report.duration(run.expected)}{'' if run.took else ' or less'}" if run.expected else "not timed yet"
        yield f"{run.command}\n    {run.since}; {time}; {'alone' if run.alone else 'shared'}"
    known = [run.expected for run in runs if run.expected]
    others = f", and {len(runs) - len(known)} not timed yet" if len(known) < len(runs) else ""
    yield f"{len(runs)} to measure: {report.duration(sum(known))}{others}"


def main(arguments: list[str] | None = None) -> int:
    """List, then measure; 1 where a command fails or the tree has changes, 130 where it is interrupted."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--list", action="store_true", help="measure nothing")
    only_list, runs, failed = parser.parse_args(arguments).list, stale(), []
    print(*told(runs), sep="\n", flush=True)
    if only_list:
        return 0
    if report.commit().endswith("+changes"):
        print("the tree has changes that are not committed: no figure is taken from it")
        return 1
    for number, run in enumerate(runs, 1):
        print(f"{number} of {len(runs)}: {shlex.join(words(run)[1:])}", flush=True)
        one_thread = {"OMP_NUM_THREADS": "1"} if run.command.startswith("OMP_NUM_THREADS=1 ") else {}
        try:
            done = subprocess.run(words(run), cwd=report.ROOT, env={**os.environ, **one_thread}, check=False)
        except KeyboardInterrupt:
            print("stopped: what has ended counts, and the same command goes on")
            return 130
        if done.returncode:
            failed.append(run.command)
    print(*(f"failed: {command}" for command in failed), sep="\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
