"""An explanation as text of 80 columns."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from vedette.text import counted

if TYPE_CHECKING:
    from vedette.control.explanation import Explanation, RunnerUp

_WIDTH = 80
_MOST_ROWS = 10
_SAME = 1e-9


def text_of(explanation: Explanation) -> str:
    """The reward, how near the next best came, and what the ten most important targets and sensors contribute."""
    lines = [*_of_choice(explanation), *_of_targets(explanation), *_of_sensors(explanation)]
    reasons: dict[str, list[str]] = {}
    for name, why in explanation.missing.items():
        reasons.setdefault(why, []).append(name)
    lines += [f"no {', '.join(names)}: {why}" for why, names in reasons.items()]
    return "\n".join(part for line in lines for part in _wrapped(line))


def _wrapped(line: str) -> list[str]:
    return textwrap.wrap(line, _WIDTH, subsequent_indent="  ") if len(line) > _WIDTH else [line]


def with_error(value: float, error: float | None) -> str:
    """`1.234 +- 0.05`."""
    return f"{value:.4g}" + ("" if error is None else f" +- {error:.2g}")


def _number(value: float, scale: float) -> str:
    """Four digits; 0 for what is rounding beside the scale."""
    return "0" if abs(value) <= _SAME * abs(scale) else f"{value:.4g}"


def _of_choice(found: Explanation) -> list[str]:
    if found.reward is None:
        return [f"{found.planner}: {'; '.join(found.chosen)}"]
    start = "" if found.baseline is None else f"; {_number(found.baseline, found.reward)} without any scan"
    lines = [f"{found.planner}: reward {with_error(found.reward, found.standard_error)}{start}"]
    bound = "" if found.bound is None else f"; {found.bound}"
    lines.append(f"{counted(found.evaluations, 'choice')} evaluated{bound}")
    if found.runner_up is not None:
        lines.append(f"runner-up: {margin_text(found.runner_up, found.reward)}: {found.runner_up.text}")
    return lines


def margin_text(runner_up: RunnerUp, reward: float) -> str:
    """`less by 0.12 +- 0.03 (4 standard errors)`."""
    if abs(runner_up.margin) <= _SAME * max(1.0, abs(reward)):
        return "as good"
    ratio = runner_up.in_standard_errors
    apart = "" if ratio is None or np.isinf(ratio) else f" ({ratio:.2g} standard errors)"
    return f"less by {with_error(runner_up.margin, runner_up.standard_error)}{apart}"


def _of_targets(found: Explanation) -> list[str]:
    gains = found.of_targets
    if gains is None:
        return []
    lines = [f"{'target':18s}{'gain':>12s}{'existence':>14s}{'localisation':>15s}"]
    order, rest = _most(gains.total)
    names = {i: ".".join(map(str, gains.labels[i].tolist())) for i in order}
    rows = [([i], names[i]) for i in order] + ([(rest, f"{len(rest)} more")] if rest else [])
    scale = float(np.abs(gains.total).max(initial=0.0))
    for which, name in rows:
        total, existence, localisation = (
            _number(float(part[which].sum()), scale) for part in (gains.total, gains.existence, gains.localisation)
        )
        lines.append(f"{name:18s}{total:>12s}{existence:>14s}{localisation:>15s}")
    if found.of_undetected:
        lines.append(f"{'not found before':18s}{found.of_undetected:12.4g}")
    return lines


def _of_sensors(found: Explanation) -> list[str]:
    shares, without = found.of_sensors, found.without
    if shares is None or without is None:
        return []
    lines = [f"{'sensor':8s}{'share':>12s}{'without it':>14s}  action"]
    order, rest = _most(shares)
    for s in sorted(order):
        row = f"{s + 1:<8d}{shares[s]:12.4g}{without[s]:14.4g}  {found.chosen[s]}"
        lines.append(row if len(row) <= _WIDTH else f"{row[: _WIDTH - 3]}...")
    if rest:
        lines.append(f"{f'{len(rest)} more':8s}{float(shares[rest].sum()):12.4g}")
    return lines


def _most(values: Sequence[float] | np.ndarray) -> tuple[list[int], list[int]]:
    """The places of the largest in magnitude, and those of the others."""
    order = np.argsort(-np.abs(np.asarray(values)), kind="stable").tolist()
    return order[:_MOST_ROWS], order[_MOST_ROWS:]
