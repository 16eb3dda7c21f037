"""The knotter's replies as text: tables for a terminal and comma-separated values."""

from __future__ import annotations

from typing import Any

from app.scenes.knotter_models import ClearanceReply, EntryReply, LimitReply, NeedleReply, PairReply, ScanReply
from app.tables import DEGREES, Units
from synthesis.sheet import csv_text


def scan_table(reply: ScanReply, units: Units = DEGREES) -> str:
    """The pairs as rows: of each condition the verdict, where, and the margin."""
    labels = ["  ".join(reply.axes), *("  ".join(f"{value:g}" for value in _place(pair)) for pair in reply.pairs)]
    width = max(map(len, labels)) + 2
    lines = [f"{labels[0]:<{width}}{'wrap':<35}{'clearance (worst)':<35}{'bite':<35}tied"]
    for label, pair in zip(labels[1:], reply.pairs):
        verdicts = "  ".join(_verdict(part) for part in (pair.wrap, pair.clearance, pair.bite))
        lines.append(f"{label:<{width}}{verdicts}  {'yes' if pair.feasible else 'no'}")
    return "\n".join(
        [*lines, f"feasible: {len(reply.feasible)} of {len(reply.pairs)}", _measured(units), _assumed(reply)]
    )


def limit_table(reply: LimitReply, units: Units = DEGREES) -> str:
    """The limits as rows."""
    lines = [
        f"  {row.value:.9f}, holds {row.holds}  {_verdict(row.wrap or row.clearance or row.bite)}"
        for row in reply.limits
    ]
    return "\n".join([f"{reply.parameter}: {reply.status}", *lines, _measured(units), _assumed(reply)])


def needle_table(reply: NeedleReply, units: Units = DEGREES) -> str:
    """The needle's figures, one a row."""
    rows = reply.model_dump(exclude={"assumed", "published", "given"})
    return "\n".join([*(f"{name:<22}{value}" for name, value in rows.items()), _measured(units, "lengths")])


def scan_csv(reply: ScanReply) -> str:
    """The pairs as comma-separated values; empty where something does not exist."""
    columns: dict[str, Any] = dict(zip(reply.axes, zip(*map(_place, reply.pairs))))
    for name in ("wrap", "clearance", "bite"):
        parts = [getattr(pair, name) for pair in reply.pairs]
        for field in () if parts[0] is None else type(parts[0]).model_fields:
            columns[f"{name}.{field}"] = [_cell(getattr(part, field)) for part in parts]
    columns |= {field: [getattr(pair, field) for pair in reply.pairs] for field in ("feasible", "margin")}
    return csv_text(columns, "\n")


def _place(pair: PairReply) -> list[float]:
    """Where in the grid a pair lies, in the order of its axes."""
    return [pair.alpha1, pair.alpha3, *(pair.parameters or {}).values()]


def _cell(value: Any) -> Any:
    return " ".join(map(repr, value)) if isinstance(value, list) else value


def _measured(units: Units, what: str = "margins and lengths") -> str:
    return f"angles in {units.angle}, {what} in {units.length or 'the unit of the lengths'}"


def _assumed(reply: ScanReply | LimitReply) -> str:
    return f"assumed, not published: {', '.join(reply.assumed) or 'nothing'}"


def _verdict(condition: EntryReply | ClearanceReply | None) -> str:
    if condition is None:
        return f"{'':33}"
    if isinstance(condition, ClearanceReply):
        where = f"{condition.worst:+.4f} at {condition.worst_angle:.4f}"
    elif condition.angle is None:
        where = "never"
    else:
        where = f"{condition.angle:.6f} {condition.edge or condition.entered_by}"
    return f"{'yes' if condition.holds else 'no ':<3} {where:<20} {condition.margin:+9.3f}"
