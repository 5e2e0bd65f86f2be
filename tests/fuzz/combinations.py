"""Small random scenarios in which any kind of any section may stand beside any other."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from fuzz.mutations import pick

Data = dict[str, Any]
Rng = np.random.Generator

REGION = {"x_min": -400.0, "x_max": 400.0, "y_min": -300.0, "y_max": 300.0}
MEASURED = {"bearing_range": 2, "bearing_only": 1, "range_only": 1, "position": 2, "custom": 1}
OWN = Path(__file__).parents[1] / "scenarios"
SHIPS = "time,id,x,y\n" + "".join(f"{2.0 * k},{ship},{9.0 * k},{50.0 * ship}\n" for k in range(12) for ship in (1, 2))
STRATEGIES = (
    *("jdm", "idm", "lookahead", "nearest", "assigned_target", "centroid"),
    *("oracle", "true_targets", "random", "constant", "stationary"),
)


def lay_beside(folder: Path) -> None:
    """Write what the scenarios name: models and parts of one's own, and recorded targets."""
    for name in ("own_parts.py", "own_models.py"):
        shutil.copy(OWN / name, folder)
    (folder / "ships.csv").write_text(SHIPS)


def combination(rng: Rng) -> Data:
    """The data of a scenario of two to four scans; most are valid."""
    num_steps = int(rng.integers(2, 5))
    dim = pick(rng, [4, 4, 4, 5, 3])
    sensors = _sensors(rng, int(pick(rng, [1, 2, 2, 3, 5])))
    data: Data = {
        "name": "any",
        "time": {"num_steps": num_steps, "step_period": pick(rng, [0.5, 1.0, 2.0]), "start": 1.0},
        "region": REGION,
        "motion": _motion(rng, dim),
        "survival": pick(rng, [{"kind": "constant", "probability": 0.95}, own_model("survival")]),
        "birth": _birth(rng, dim, num_steps, sensors),
        "targets": _targets(rng, dim, num_steps),
        "sensors": sensors,
        "filter": _filter(rng, len(sensors)),
        "control": _control(rng, num_steps),
        "planners": {name: _planner(rng) for name in ("own", "other")[: int(rng.integers(3))]},
        "ospa": _ospa(rng, num_steps),
    }
    data["fusion"] = _fusion(rng, len(sensors), data["filter"]["kind"])
    data |= {
        "estimator": pick(
            rng, [*({"kind": kind} for kind in ("map", "map", "marginal", "least_gospa")), own_part("sure")]
        ),
        "metrics": pick(rng, [{}, {"share": {"kind": "tracked_fraction"}}, {"count": own_part("count")}]),
    }
    if rng.random() < 0.25:
        data["network"] = _network(rng)
    if rng.random() < 0.3:
        data["undetected"] = _undetected(rng)
    elif rng.random() < 0.95:
        data["control"].pop("undetected_target_value", None)
    if "lookahead" in data["control"] and rng.random() < 0.95:
        data["control"]["association"] = "known"
    return data


def own_part(name: str, **arguments: Any) -> Data:
    return {"kind": "custom", "function": f"own_parts.py:{name}", "arguments": arguments}


def own_model(name: str, **fields: Any) -> Data:
    return {"kind": "custom", "function": f"own_models.py:{name}", **fields}


def _vector(rng: Rng, dim: int, spread: float = 200.0) -> list[float]:
    state = [*rng.uniform(-spread, spread, 2), *rng.uniform(-5.0, 5.0, 2), 0.02]
    return [float(value) for value in state[:dim]]


def _motion(rng: Rng, dim: int) -> Data:
    order = pick(rng, [{}, {"state_order": "grouped"}, {"state_order": "interleaved"}])
    if dim == 3:
        return own_model("motion", components=["px", "py", "own_2"])
    if dim == 5:
        return {"kind": "coordinated_turn", "sigma_v": 1.0, **order}
    return {
        "kind": "constant_velocity",
        "sigma_v": pick(rng, [0.0, 1.0]),
        "noise_model": "discrete_white",
        **order,
    } | pick(rng, [{}, {"noise_model": "continuous_white"}])


def _birth(rng: Rng, dim: int, last: int, sensors: list[Data]) -> Data:
    std = [20.0, 20.0, 3.0, 3.0, 0.05][:dim]
    site: Data = {"existence": 0.1, "mean": _vector(rng, dim)}
    site |= {"std": std} if rng.random() < 0.7 else {"cov": np.diag(np.square(std)).tolist()}
    sees = all(MEASURED[own["measurement"]["kind"]] == 2 for own in sensors) or rng.random() < 0.05
    least = 0 if sees else 1
    birth: Data = {"steps": pick(rng, ["every", "every", [1], [1, last], []])}
    birth["sites"] = [site] * int(rng.integers(least, 3))
    if (sees and rng.random() < 0.3) or not birth["sites"]:
        birth["from_measurements"] = {"std": std}
    return birth


def _targets(rng: Rng, dim: int, last: int) -> Data:
    how = rng.random()
    if how < 0.15:
        return {
            "kind": "uniform",
            "number": int(rng.integers(1, 6)),
            "std": [3.0] * (dim - 2),
            "death_probability": 0.1,
        }
    if how < 0.3:
        std = [30.0, 30.0, 3.0, 3.0, 0.02][:dim]
        return {"kind": "poisson", "expected": 0.5, "mean": _vector(rng, dim), "std": std, "death_probability": 0.1}
    if how < 0.45:
        return {"kind": "recorded", "path": "ships.csv", "crop": bool(rng.integers(2))}
    tracks = [
        {
            "state": _vector(rng, dim),
            "start_step": int(rng.integers(1, last + 1)),
            "process_noise": bool(rng.integers(2)),
            **pick(rng, [{}, {"end_step": last}, {"std": [1.0] * dim}]),
        }
        for _ in range(int(rng.integers(4)))
    ]
    return {"kind": "scripted", "tracks": tracks}


def _sensors(rng: Rng, num: int) -> list[Data]:
    """Alike, or each of its own kind."""
    alike = rng.random() < 0.5
    first = _sensor(rng)
    made = [first if alike else _sensor(rng) for _ in range(num)]
    return [{**one, "position": _vector(rng, 2, 300.0), "heading_deg": float(rng.uniform(-180, 180))} for one in made]


def _sensor(rng: Rng) -> Data:
    kind = pick(rng, ["bearing_range", "bearing_range", "position", "position", "bearing_only", "range_only", "custom"])
    platform = _platform(rng)
    sensor = {
        "measurement": own_model("measurement") if kind == "custom" else {"kind": kind},
        "noise": _noise(rng, kind),
        "clutter": _clutter(rng, kind),
        "platform": platform,
        "stationary_until_first_decision": bool(rng.integers(2)),
        "detection": _detection(rng, platform),
    }
    if rng.random() < 0.2:
        sensor["true_parameters"] = pick(
            rng,
            [
                {"noise": _noise(rng, kind)},
                {"detection": _detection(rng, platform), "first_detection": _detection(rng, platform)},
                {"clutter": _clutter(rng, kind), "detection_of": "measurement"},
                {"measurement": sensor["measurement"]},
            ],
        )
    if rng.random() < 0.2:
        sensor["scans"] = {"every": 2, "first": int(rng.integers(1, 3))}
    if rng.random() < 0.3:
        sensor["switchable"] = True
    if rng.random() < 0.2:
        sensor["price"] = float(rng.uniform(-1.0, 3.0))
    if rng.random() < 0.1:
        sensor.setdefault("scans", {})["late"] = {"max_delay": 1.0, "probability": 0.5}  # type: ignore[index]
    return sensor


def _noise(rng: Rng, kind: str) -> Data:
    if kind == "custom":
        return pick(rng, [own_model("noise"), {"kind": "constant", "std": [2.0]}])
    std = {"bearing_range": [0.02, 5.0], "bearing_only": [0.02], "range_only": [5.0], "position": [5.0, 5.0]}[kind]
    grown = {"kind": "by_axis", "std": [3.0, 3.0], "quadratic_growth": [1e-4, 0.0]}
    other = grown if kind == "position" else {"kind": "range_dependent"}
    return pick(rng, [{"kind": "constant", "std": std}, other])


def _clutter(rng: Rng, kind: str) -> Data:
    rate = pick(rng, [0.0, 2.0])
    if kind == "custom":
        return pick(rng, [own_model("clutter"), {"kind": "measurement_space", "rate": rate, "low": [0], "high": [900]}])
    ends = {
        "bearing": ([-3.0], [3.0]),
        "range": ([0.0], [900.0]),
        "only": ([], []),
        "position": ([-9e2] * 2, [9e2] * 2),
    }
    low, high = ([float(x) for word in kind.split("_") for x in ends[word][end]] for end in (0, 1))
    box = {"kind": "measurement_space", "rate": rate, "low": low, "high": high}
    around = {"kind": "around_sensor", "rate": rate, **pick(rng, [{"radius": 300.0}, {"half_side": 300.0}])}
    whole = {"kind": "region", "rate": rate}
    return pick(rng, [whole, whole, box, around] if MEASURED[kind] == 2 else [whole, box])


def _platform(rng: Rng) -> Data:
    headings = [-90.0, 0.0, 90.0]
    carriers: list[Data] = [
        {"kind": "stationary"},
        {"kind": "heading", "speed": 5.0, "headings_deg": headings, "relative": bool(rng.integers(2))},
        {"kind": "heading", "speeds": [0.0, 5.0], "headings_deg": headings},
        {
            "kind": "grid_moves",
            "length": 10.0,
            "speed": 20.0,
            "directions_deg": headings,
            "allow_staying": bool(rng.integers(2)),
        },
        {"kind": "waypoints", "points": [[0.0, 0.0], [90.0, 50.0]], "speed": 5.0, "closed": bool(rng.integers(2))},
        own_part("Hopper"),
    ]
    if rng.random() < 0.8:
        return pick(rng, carriers)
    zooms: Data = pick(rng, [{}, {"half_widths_deg": [20.0, 60.0]}, {"turn_rate_deg": 20.0}, {"relative": True}])
    carrier: Data = pick(rng, [{}, {"platform": pick(rng, carriers)}])
    return {"kind": "camera", "half_width_deg": 40.0, "pointings_deg": [0.0, 120.0], **zooms, **carrier}


def _detection(rng: Rng, platform: Data) -> Data:
    if platform["kind"] == "camera" and rng.random() < 0.7:
        reference = pick(rng, [{}, {"reference_half_width_deg": 40.0}])
        return {"kind": "camera", "probability": 0.9, "max_range": 500.0, **reference}
    near = {"probability": 0.9, "max_range": 400.0}
    soft = {**near, "kind": "soft_sector", "range_slope": 0.05}
    kinds: list[Data] = [
        {"kind": "gaussian", "sigma": 800.0},
        {"kind": "constant", "probability": pick(rng, [0.9, 0.9, 1.0, 0.0])},
        {"kind": "limited_range", **near, "outside": pick(rng, [0.0, 0.2])},
        {"kind": "limited_sector", **near, "half_width_deg": 60.0},
        {**soft, "half_width_deg": 60.0, "angle_slope": pick(rng, [None, 10.0])},
        {**soft, "hard_limit": True},
        own_model("detection"),
    ]
    return pick(rng, kinds)


def _filter(rng: Rng, num_sensors: int) -> Data:
    unlabelled = ["phd", "cphd", "cb_member"] if num_sensors == 1 or rng.random() < 0.1 else []
    kind = pick(rng, ["factored_glmb", "lmb", "delta_glmb", "m_delta_glmb", "custom", *unlabelled])
    shared: Data = pick(rng, [{}, {}, {"gaussian_method": pick(rng, ["ekf", "ukf", "ckf"])}, {"detection_at": "mean"}])
    if kind == "custom":
        return {**own_part("Filter"), **shared}
    made = {"kind": kind, **shared}
    if rng.random() < 0.5:
        made["limits"] = {"max_hypotheses": 20, **pick(rng, [{}, {"max_position_std": 60.0}, {"max_labels": 3}])}
    if kind in ("delta_glmb", "m_delta_glmb") and rng.random() < 0.3:
        made["assignment"] = {"kind": "gibbs", "num_samples": 20}
    return made


def _fusion(rng: Rng, num_sensors: int, filters: str) -> Data:
    if num_sensors == 1 and rng.random() < 0.7:
        return {"kind": "none"}
    fitting = {
        "lmb": ["sequential", "parallel", "clmb", "arithmetic_average", "central"],
        "factored_glmb": ["sequential", "parallel", "clmb", "cm_delta_glmb", "arithmetic_average", "central"],
        "custom": ["custom", "clmb", "arithmetic_average", "parallel", "cm_delta_glmb", "sequential"],
    }.get(filters, ["sequential", "clmb", "cm_delta_glmb", "arithmetic_average", "central"])
    kind = pick(rng, [*fitting, *fitting, "custom"])
    if kind == "custom":
        return {**own_part("fusion", first=0.4 if num_sensors > 1 else 1.0), "feedback": bool(rng.integers(2))}
    made: Data = {"kind": kind}
    if kind in ("clmb", "cm_delta_glmb", "arithmetic_average"):
        made["feedback"] = bool(rng.random() < 0.4)
        made["matching"] = pick(rng, ["labels", "assignment"])
        made["field_of_view_weighting"] = bool(rng.random() < 0.3) and kind != "cm_delta_glmb"
    if rng.random() < 0.3:
        made["weights"] = [1.0 / num_sensors] * num_sensors
    if rng.random() < 0.3:
        made["mixture_power"] = pick(rng, ["moment_matched", "component_wise", "quadrature"])
        made["limits"] = {"max_components": 2}
    return made


def _network(rng: Rng) -> Data:
    network: Data = pick(
        rng, [{}, {"max_hops": 1}, {"delay": 1}, {"consensus_rounds": 2}, {"link_loss_probability": 0.5}]
    )
    return {**network, **pick(rng, [{}, {"radio_range": 400.0}])}


def _undetected(rng: Rng) -> Data:
    made: Data = {
        "cell_size": 100.0,
        "expected": 3.0,
        "speed": 2.0,
        "birth_density": pick(rng, ["uniform", "boundary"]),
    }
    return {**made, **pick(rng, [{}, {"birth_rate": 0.1}, {"survival": 0.9}, {"region": REGION}])}


def _control(rng: Rng, last: int) -> Data:
    decisions: Data = pick(rng, [{"decision_steps": [1]}, {"decision_steps": [1, last]}, {"decision_times": [1.0]}])
    control = {
        **decisions,
        "horizon_steps": int(rng.integers(1, 3)),
        "num_samples": 2,
        "ideal_measurements": pick(rng, ["ideal", "expected", "sampled"]),
        "association": pick(rng, ["known", "known", "full"]),
        "reward": _reward(rng),
        "search": _search(rng),
        "constraints": [_constraint(rng) for _ in range(int(pick(rng, [0, 0, 1, 2])))],
        "explain": bool(rng.integers(2)),
    }
    if rng.random() < 0.2:
        del control["reward"]
    if rng.random() < 0.2:
        control |= {"confidence": 0.6, "max_samples": 24, "indifference": pick(rng, [0.0, 0.1])}
    if rng.random() < 0.2:
        control["undetected_target_value"] = 2.0
    if rng.random() < 0.3:
        control["lookahead"] = _lookahead(rng)
    if rng.random() < 0.3:
        control["limits"] = pick(rng, [{"max_glmb_sensors": 0}, {"max_glmb_targets": 0}, {"max_hypotheses": 3}])
    return control


def _lookahead(rng: Rng) -> Data:
    made: Data = {"depth": int(rng.integers(1, 3)), "discount": pick(rng, [None, 0.9]), "budget": pick(rng, [4, 200])}
    how: Data = pick(rng, [{}, {"method": "beam", "beam_width": 2}, {"method": "tree", "rollout": "repeat_last"}])
    return {**made, **how, **pick(rng, [{}, {"period": 2.0}])}


def _reward(rng: Rng) -> Data:
    made: Data = pick(
        rng,
        [
            {"kind": "cauchy_schwarz"},
            {"kind": "cauchy_schwarz", "unit_volume": "reference"},
            {"kind": "renyi"},
            {"kind": "kullback_leibler"},
            {"kind": "cardinality_variance"},
            {"kind": "expected_gospa"},
            {"kind": "peecs"},
            {"kind": "expected_loss"},
            own_part("reward"),
            own_part("Overlap", power=0.5),
            own_part("Powers"),
        ],
    )
    return made


def _search(rng: Rng) -> Data:
    made: Data = pick(
        rng,
        [
            {"kind": "automatic"},
            {"kind": "exhaustive"},
            {"kind": "coordinate_ascent", "num_restarts": 1},
            {"kind": "sequential_greedy", "order": pick(rng, ["sensor_order", "best_first"])},
            {"kind": "cross_entropy", "num_samples": 5, "max_rounds": 2},
            own_part("FirstOfAll"),
        ],
    )
    return made


def _constraint(rng: Rng) -> Data:
    made: Data = pick(
        rng,
        [
            {"kind": "stay_inside", "region": REGION},
            {"kind": "keep_out", "region": {"x_min": 0.0, "x_max": 90.0, "y_min": 0.0, "y_max": 90.0}},
            {"kind": "keep_out", "polygon": [[0.0, 0.0], [90.0, 0.0], [0.0, 90.0]]},
            {"kind": "separation", "distance": 50.0},
            {"kind": "max_active", "sensors": int(rng.integers(1, 3))},
            {"kind": "void_probability", "radius": 30.0, "probability": 0.5},
            own_part("OddOnes"),
        ],
    )
    return made


def _planner(rng: Rng) -> Data:
    how = rng.random()
    if how < 0.5:
        return {"kind": "joint", **pick(rng, [{}, {"search": _search(rng)}, {"reward": _reward(rng)}])}
    if how < 0.7:
        return {"kind": "independent", **pick(rng, [{}, {"reward": _reward(rng)}])}
    if how < 0.85:
        return {"kind": pick(rng, ["nearest", "assigned_target", "centroid"])}
    if how < 0.95:
        return {"kind": "oracle", "depth": int(rng.integers(1, 3))}
    return own_part("Last")


def _ospa(rng: Rng, last: int) -> Data:
    made: Data = {"components": pick(rng, ["position", "position", "state"]), "order": pick(rng, [1.0, 2.0])}
    return {**made, **pick(rng, [{}, {"cutoff": 20.0}, {"first_scan": 2, "last_scan": last}, {"window": 2}])}
