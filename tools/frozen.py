"""What a checkout computes, to the last digit, and where two checkouts differ.

    python tools/frozen.py write before.npz                  # of the library in src/ of this checkout
    python tools/frozen.py write before.npz --of COMMIT      # of another commit, in a work tree of its own
    python tools/frozen.py compare before.npz after.npz
    python tools/frozen.py compare before.npz after.npz --within 1e-9

Cases are of two kinds: random small scenarios in which any kind of any section may stand beside any other
(`tests/fuzz/combinations.py`), and built-in scenarios under filters, fusions, rewards and searches, with 40 seeds of
the paper's. Of each run it keeps the beliefs of all scans (existence, moments of every label, cardinality), what was
decided on what evidence, estimates, and the measures of the run. Numbers count as equal within 1e-12 of the larger
magnitude; those that are not equal in every bit are counted, too. Ends with 1 where something differs.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields, replace
from importlib import import_module
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
WITHIN = 1e-12
Arrays = dict[str, np.ndarray]


class Case(NamedTuple):
    """One run of a strategy, on a built-in scenario with some fields changed; or a random one, by its number."""

    name: str
    scenario: str
    fields: dict[str, Any]
    strategy: str = "jdm"
    run: int = 0


RANDOM = "random"
_MOST_DRAWS = 8  # for a random scenario that is valid


def cases(num_random: int) -> Iterator[Case]:
    """All of them."""
    short = {"time.num_steps": 12, "control.decision_steps": [10], "ospa.last_scan": 12}
    for run, strategy in product(range(40), ("jdm", "idm")):
        yield Case(f"paper-a/{strategy}/{run}", "paper-a", short, strategy, run)
    filters = {
        "delta_glmb": ("sequential", "cm_delta_glmb", "clmb", "arithmetic_average", "central"),
        "m_delta_glmb": ("sequential", "cm_delta_glmb"),
        "lmb": ("sequential", "parallel", "clmb", "arithmetic_average", "central"),
        "factored_glmb": ("sequential", "parallel", "clmb", "cm_delta_glmb", "central"),
    }
    scenes: dict[str, tuple[dict[str, Any], str]] = {
        "paper-a": (short, "jdm"),
        "six-cameras": ({"control.decision_steps": [2, 4]}, "jdm"),
        "eight-mobile": ({"control.decision_steps": [2]}, "jdm"),
        "three-radars": ({}, "stationary"),
    }
    for scene, (changes, strategy) in scenes.items():
        for kind, fusions in filters.items():
            for fusion in fusions:
                by_label = fusion in ("clmb", "cm_delta_glmb", "arithmetic_average")
                matching = {"matching": "assignment"} if by_label and scene != "paper-a" else {}
                made = {**changes, "filter": {"kind": kind}, "fusion": {"kind": fusion, **matching}}
                yield Case(f"{scene}/{kind}/{fusion}", scene, made, strategy)
    rewards = ("cauchy_schwarz", "renyi", "kullback_leibler", "expected_loss", "expected_gospa", "peecs")
    searches = ("exhaustive", "coordinate_ascent", "cross_entropy", "sequential_greedy", "automatic")
    for reward, search in product((*rewards, "cardinality_variance"), searches):
        lmbs = {"filter": {"kind": "lmb"}, "fusion": {"kind": "clmb"}}
        changes = {"control.reward": {"kind": reward}, "control.search": {"kind": search}}
        yield Case(f"reward/{reward}/{search}", "paper-a", short | lmbs | changes)
    for kind, scene in product(("phd", "cphd", "cb_member", *filters), ("linear-10", "polar-10")):
        yield Case(f"{scene}/{kind}", scene, {"filter": {"kind": kind}, "estimator": {"kind": "map"}}, "stationary")
    for strategy in (
        "lookahead",
        "nearest",
        "assigned_target",
        "centroid",
        "oracle",
        "true_targets",
        "random",
        "constant",
    ):
        yield Case(f"strategy/{strategy}", "paper-a", short, strategy)
    for number in range(num_random):
        yield Case(f"{RANDOM}/{number:04}", RANDOM, {}, run=number)


class Watched:
    """A tracker whose states are kept."""

    def __init__(self, tracker: Any) -> None:
        self.tracker, self.states = tracker, list[Any]()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.tracker, name)

    def initial(self) -> Any:
        return self.tracker.initial()

    def step(self, *given: Any, **named: Any) -> Any:
        state, info = self.tracker.step(*given, **named)
        self.states.append(state)
        return state, info


def computed(case: Case) -> Arrays:
    """What comes of a case, by name; of one that raises, what was said."""
    from vedette.errors import VedetteError

    with tempfile.TemporaryDirectory() as folder:
        try:
            return _run(case, Path(folder))
        except (VedetteError, ValueError) as error:
            return {"error": np.array(f"{type(error).__name__}: {error}".replace(folder, ""))}


def _run(case: Case, folder: Path) -> Arrays:
    from vedette.evaluation.runs import build_score, measure_run
    from vedette.scenarios import load_scenario, replace_fields
    from vedette.scenarios.build import build_experiment, build_planner
    from vedette.simulation import simulate

    if case.scenario == RANDOM:
        strategy, scenario = _random(case.run, folder), load_scenario(folder / "scenario.yaml")
    else:
        strategy, scenario = case.strategy, replace_fields(load_scenario(case.scenario), case.fields)
    experiment, planner = build_experiment(scenario), build_planner(scenario, strategy, 1)
    watched = Watched(experiment.tracker)
    score = build_score(scenario)
    record = simulate(replace(experiment, tracker=watched), planner, seed=3, run=case.run, score=score)
    found: Arrays = {"poses": record.poses, "ospa": record.ospa}
    for k, (state, estimate) in enumerate(zip(watched.states, record.estimates, strict=True)):
        found |= {f"scan {k}/means": estimate.means, f"scan {k}/covs": estimate.covs}
        beliefs = {"fused": state.fused} | {f"local {s}": own for s, own in enumerate(state.local)}
        for name, belief in beliefs.items():
            if name == "fused" or belief is not state.fused:
                found |= {f"scan {k}/{name}/{key}": value for key, value in _belief(belief).items()}
    for d, decision in enumerate(record.decisions):
        found[f"decision {d}/chosen"] = np.array(decision.plan.chosen)
        for t, own in enumerate(decision.plan.tables):
            found |= {f"decision {d}/table {t}/mean": own.mean, f"decision {d}/table {t}/error": own.standard_error}
        if decision.plan.bound is not None:
            found[f"decision {d}/bound"] = np.array([decision.plan.bound.upper, decision.plan.bound.reward])
    measures = measure_run(record, scenario)
    for measure in fields(measures):
        value = np.asarray(getattr(measures, measure.name))
        if value.dtype.kind in "bif" and "seconds" not in measure.name:
            found[f"measures/{measure.name}"] = value
    return found


def _random(number: int, folder: Path) -> str:
    """Write a random scenario, and what it names, into a folder; the strategy for it."""
    if (tests := str(ROOT / "tests")) not in sys.path:
        sys.path.insert(0, tests)
    from vedette.errors import ScenarioError
    from vedette.scenarios import load_scenario

    combinations = import_module("fuzz.combinations")
    combinations.lay_beside(folder)
    rng = np.random.default_rng([20, number])
    for _ in range(_MOST_DRAWS):
        (folder / "scenario.yaml").write_text(json.dumps(combinations.combination(rng)))
        try:
            load_scenario(folder / "scenario.yaml")
            break
        except ScenarioError:
            continue
    return str(rng.choice([*combinations.STRATEGIES, "jdm", "jdm", "jdm"]))


def _belief(belief: Any) -> Arrays:
    """A labelled belief by its labels in order, an unlabelled one by its numbers of targets."""
    from vedette.densities import LabelledDensity, as_lmb, cardinality_distribution, track_moments

    found = {"cardinality": cardinality_distribution(belief)}
    if not isinstance(belief, LabelledDensity):
        return found
    lmb = as_lmb(belief)
    order = np.lexsort(lmb.tracks.labels.T[::-1])
    moments = track_moments(lmb.tracks) if len(order) else (np.empty((0, 1)), np.empty((0, 1, 1)))
    means, covs = (np.asarray(own) for own in moments)
    return found | {
        "labels": lmb.tracks.labels[order],
        "existence": lmb.existence[order],
        "label means": means[order],
        "label covs": covs[order],
    }


def write(place: Path, num_random: int, workers: int) -> None:
    """All cases into one file."""
    todo, found = list(cases(num_random)), Arrays()
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        for case, arrays in zip(todo, pool.map(computed, todo), strict=True):
            found |= {f"{case.name}: {key}": value for key, value in arrays.items()}
    np.savez_compressed(place, **found)  # type: ignore[arg-type]
    errors = sum(key.endswith(": error") for key in found)
    print(f"{len(todo)} cases, {errors} of them refused, {len(found)} arrays")


def write_of(commit: str, place: Path, num_random: int, workers: int) -> None:
    """Likewise, of the library of another commit, by the cases of this checkout."""
    with tempfile.TemporaryDirectory() as folder:
        tree = str(Path(folder) / "tree")
        subprocess.run(["git", "-C", ROOT, "worktree", "add", "--quiet", "--detach", tree, commit], check=True)
        try:
            command = [sys.executable, __file__, "write", str(place.resolve()), "--random", str(num_random)]
            environment = {**os.environ, "PYTHONPATH": str(Path(tree) / "src")}
            subprocess.run([*command, "--workers", str(workers)], env=environment, check=True)
        finally:
            subprocess.run(["git", "-C", ROOT, "worktree", "remove", "--force", tree], check=True)


def difference(before: np.ndarray, after: np.ndarray) -> float:
    """Largest, relative to the larger magnitude of the array or to 1; inf where they are not of one kind."""
    if before.shape != after.shape or before.dtype.kind != after.dtype.kind:
        return np.inf
    if before.dtype.kind not in "fc":
        return 0.0 if (before == after).all() else np.inf
    if not (np.isfinite(before) == np.isfinite(after)).all():
        return np.inf
    known = np.isfinite(before)
    if not np.array_equal(before[~known], after[~known], equal_nan=True):
        return np.inf
    if not known.any():
        return 0.0
    scale = max(float(np.abs(before[known]).max()), float(np.abs(after[known]).max()), 1.0)
    return float(np.abs(before[known] - after[known]).max()) / scale


def compare(before: Path, after: Path, within: float) -> int:
    """Print where two files differ; 1 where they do by more than `within`."""
    first, second = np.load(before), np.load(after)
    missing = set(first.files) ^ set(second.files)
    worst, counts = dict[str, tuple[float, str]](), Counter[str]()
    for key in first.files:
        if key in missing:
            continue
        case, _, what = key.partition(": ")
        one, other = first[key], second[key]  # unpacked whenever they are asked for
        apart = difference(one, other)
        same = apart == 0.0 and one.tobytes() == other.tobytes()
        counts["equal in every bit" if same else f"within {within:g}" if apart <= within else "different"] += 1
        if apart > within:
            worst[case] = max(worst.get(case, (0.0, "")), (apart, what))
    for case, (apart, what) in sorted(worst.items()):
        print(f"{case}: {what}: {apart:.3g}")
    for key in sorted(missing):
        print(f"{key}: only in {before if key in first.files else after}")
    print(", ".join(f"{number} arrays {how}" for how, number in counts.items()) + f", {len(missing)} in one file alone")
    return int(bool(worst or missing))


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    writing = commands.add_parser("write", help="compute all cases")
    writing.add_argument("place", type=Path)
    writing.add_argument("--of", help="a commit; without it the library that Python finds")
    writing.add_argument("--random", type=int, default=400, help="random scenarios")
    writing.add_argument("--workers", type=int, default=2, help="processes")
    comparing = commands.add_parser("compare", help="print where two files differ")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    comparing.add_argument("--within", type=float, default=WITHIN, help="relative difference that is none")
    given = parser.parse_args()
    if given.command == "compare":
        return compare(given.before, given.after, given.within)
    if given.of is not None:
        write_of(given.of, given.place, given.random, given.workers)
    else:
        write(given.place, given.random, given.workers)
    return 0


if __name__ == "__main__":
    sys.exit(main())
