"""The lift's answers as text for a terminal."""

from __future__ import annotations

from app.scenes.lift_models import BatchReply, DesignReply, MotionReply, OptimizeReply

TABLE_ROWS = 21
"""Times that the table of a motion shows."""
LENGTHS = ("l2", "l3", "l4", "l5", "b")


def motion_table(reply: MotionReply) -> str:
    """The motion as text: the figures first, then at most `TABLE_ROWS` times."""
    lines = [
        f"{reply.direction} from {reply.height_start:.6g} to {reply.height_end:.6g} mm in {reply.rise_time:.6f} s",
        f"dead point at cylinder length {reply.dead_point_length:.6g} mm (height {reply.dead_point_height:.6g} mm), "
        f"top at {reply.length_top:.6g} mm",
        f"condition: start {reply.condition.start:.4g}, top {reply.condition.top:.4g}, min {reply.condition.min:.4g}",
    ]
    if reply.residual is not None:
        lines.append(f"largest loop residual {reply.residual:.2g} mm")
    for pose in reply.assemblies or []:
        lines.append(f"assembly at height {pose.height:.6g} mm{' (working branch)' if pose.working else ''}")
    if reply.forces is not None:
        lines.append(
            f"cylinder force {reply.forces.cylinder_min:.6g} to {reply.forces.cylinder_max:.6g} N, pressure up to "
            f"{reply.forces.pressure_max:.4g} bar ({'enough' if reply.forces.pressure_is_enough else 'not enough'}), "
            f"least bore {reply.forces.bore_min:.4g} mm"
        )
    lines += ["", f"{'time s':>12} {'height mm':>14} {'velocity mm/s':>14} {'acc. mm/s^2':>14} {'cylinder mm':>14}"]
    last = len(reply.time) - 1
    rows = sorted({round(k * last / (TABLE_ROWS - 1)) for k in range(TABLE_ROWS)})
    for k in rows:
        values = (reply.height[k], reply.velocity[k], reply.acceleration[k], reply.cylinder_length[k])
        lines.append(f"{reply.time[k]:12.6g} " + " ".join(f"{value:14.8g}" for value in values))
    if len(rows) <= last:
        lines.append(f"({len(rows)} of {last + 1} times; --json shows all)")
    return "\n".join(lines)


def optimize_table(reply: OptimizeReply) -> str:
    """The optimum as text, the published design beside it."""
    columns: list[tuple[str, DesignReply, float]] = [("optimum", reply.design, reply.objective)]
    if reply.published:
        columns.append(("published", reply.published.design, reply.published.objective))
    lines = [f"{'mm':>10} " + " ".join(f"{name:>14}" for name, _, _ in columns)]
    for name in LENGTHS:
        lines.append(f"{name:>10} " + " ".join(f"{getattr(design, name):14.6f}" for _, design, _ in columns))
    lines.append(f"{'objective':>10} " + " ".join(f"{value:14.7g}" for _, _, value in columns))
    lines += [
        f"{'closed l1':>10} {reply.closed_length:14.6f}",
        "",
        f"active: {', '.join(reply.active) or 'none'}",
        f"rise time {reply.motion.rise_time:.6f} s, speed at the start {reply.motion.velocity_start:.6g} mm/s, "
        f"mean over height {reply.motion.velocity_mean:.6g} mm/s",
    ]
    if reply.published:
        lines.append(f"published: {reply.published.reason}")
    if reply.constraints:
        lines += ["", f"{'constraint':>20} {'is':>14}        {'limit':>14}"]
        for row in reply.constraints:
            sign = ">=" if row.kind == "least" else "<="
            lines.append(f"{row.name:>20} {row.value:14.7g} {sign:>6} {row.limit:14.7g}{' *' if row.active else ''}")
        lines += ["* holds the design", ""]
    if reply.unconstrained and reply.cost is not None:
        broken = ", ".join(f"{row.name} {row.value:.6g}" for row in reply.unconstrained.breaks)
        lines.append(
            f"the source's problem has the objective {reply.unconstrained.objective:.6g} (this one: {reply.cost:+.1%}) "
            f"and is outside of: {broken or 'no limit'}"
        )
    lines.append(reply.note)
    return "\n".join(lines)


def batch_table(reply: BatchReply) -> str:
    """One line for each cylinder."""
    names = ("length", "speed", *LENGTHS, "objective", "published", "rise time")
    lines = [" ".join(f"{name:>11}" for name in names)]
    for row in reply.rows:
        head = f"{row.cylinder['length']:11.6g} {row.cylinder['speed']:11.6g} "
        if row.design is None or row.motion is None or row.objective is None:
            lines.append(head + f"{row.constraint}: {row.detail}")
            continue
        values = [f"{getattr(row.design, name):11.4f}" for name in LENGTHS]
        published = "-" if row.objective_of_published is None else f"{row.objective_of_published:.4f}"
        lines.append(head + " ".join(values) + f" {row.objective:11.4f} {published:>11} {row.motion.rise_time:11.6f}")
    return "\n".join(lines)
