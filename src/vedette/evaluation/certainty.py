"""How sure the decisions of a run were, in words: how near the second best came, and how far the best may be."""

from __future__ import annotations

import math

from vedette.simulation.records import RunRecord
from vedette.text import counted


def certainty_lines(record: RunRecord) -> list[str]:
    """A line on the closest decision, and one on the bounds; none where decisions were kept without explanation."""
    kept = [(each, why) for each in record.decisions if (why := each.plan.explanation) is not None]
    lines = []
    close = [
        (ratio, each.time, second)
        for each, why in kept
        if (second := why.runner_up) is not None and (ratio := second.in_standard_errors) is not None
    ]
    if close:
        ratio, time, second = min(close, key=lambda found: found[0])
        apart = "as good" if ratio <= 0.0 else f"{second.margin:.3g} less, {ratio:.2g} standard errors"
        lines.append(f"closest decision: at {time:g} s the second best is {apart}")
    bounds = [why.bound for _, why in kept if why.bound is not None]
    if not bounds:
        return lines
    known = [bound for bound in bounds if math.isfinite(bound.upper)]
    best = sum(bound.gap <= 0.0 for bound in known)
    text = f"bounds: {best} of {counted(len(bounds), 'joint decision')} the best there is"
    gaps = [bound.relative for bound in known if bound.gap > 0.0]
    text += f", {len(gaps)} at most {100.0 * max(gaps):.2g} % below it" if gaps else ""
    unknown = len(bounds) - len(known)
    return [*lines, text + (f", {unknown} without bound" if unknown else "")]
