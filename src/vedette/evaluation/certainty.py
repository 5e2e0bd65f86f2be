"""Certainty of a decision in words: its lead over the runner-up, and whether it is proven optimal."""

import math

from vedette.control.plan import Plan


def lead_words(plan: Plan) -> str:
    """Return the lead in mean reward over the runner-up, `0.071 (3.3 std. errors)`, empty if it is not recorded."""
    runner_up = None if plan.explanation is None else plan.explanation.runner_up
    if runner_up is None:
        return ""
    ratio = runner_up.in_standard_errors
    if ratio is None or not math.isfinite(ratio):
        return f"{runner_up.margin:.3g}"
    return f"{runner_up.margin:.3g} ({ratio:.2g} std. errors)"


def optimality_words(plan: Plan) -> str:
    """Return `yes` for a proven optimum, `within 6.1 %` of it, or `not known`, empty for decisions without a bound."""
    bound = None if plan.explanation is None else plan.explanation.bound
    if bound is None:
        return ""
    if bound.gap <= 0.0:
        return "yes"
    return f"within {100.0 * bound.relative:.2g} %" if bound.is_close else "not known"
