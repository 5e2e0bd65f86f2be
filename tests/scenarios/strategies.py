"""Random valid scenarios, section by section."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

Data = dict[str, Any]

finite = st.floats(-1e9, 1e9, allow_nan=False)
positive = st.floats(1e-9, 1e9)
zero_or_more = st.floats(0.0, 1e9)
rates = st.floats(0.0, 1e6)
probability = st.floats(0.0, 1.0)
inner = st.floats(1e-6, 1.0 - 1e-6)
counts = st.integers(1, 10**6)
# Among them words that YAML could take for something else.
words = st.sampled_from(
    ["no", "yes", "1e3", "~", "null", "true", "0x1F", "- a", "a: b", "#c", "2016-01-12", ":0", "1_0", " é", "'q'"]
)
names = words | st.text(st.characters(categories=["L", "N", "P", "S"]), min_size=1, max_size=12)
references = st.sampled_from(["json:loads", "os.path:join", "collections:abc.Mapping"])
arguments = st.dictionaries(
    names, st.none() | st.booleans() | finite | names | st.lists(st.integers(), max_size=3), max_size=2
)


def vector(length: int, of: st.SearchStrategy[float] = finite) -> st.SearchStrategy[list[float]]:
    return st.lists(of, min_size=length, max_size=length)


def section(kind: str | None = None, **fields: st.SearchStrategy[Any]) -> st.SearchStrategy[Data]:
    """A mapping in which every field may be left out, so that its default stands in."""
    fixed = {} if kind is None else {"kind": st.just(kind)}
    return st.fixed_dictionaries(fixed, optional=fields)


def needed(kind: str | None = None, **fields: st.SearchStrategy[Any]) -> st.SearchStrategy[Data]:
    """A mapping with all of its fields."""
    fixed = {} if kind is None else {"kind": st.just(kind)}
    return st.fixed_dictionaries({**fixed, **fields})


def custom(**fields: st.SearchStrategy[Any]) -> st.SearchStrategy[Data]:
    return needed("custom", function=references, arguments=arguments, **fields)


order = st.sampled_from(["grouped", "interleaved"])
motions = {
    4: section("constant_velocity", sigma_v=zero_or_more, state_order=order),
    5: section("coordinated_turn", sigma_v=zero_or_more, sigma_turn_rate_deg=zero_or_more, state_order=order),
    3: custom(state_dim=st.just(3)),
}
angles = st.lists(finite, min_size=1, max_size=5)
detections = st.one_of(
    section("gaussian", sigma=positive),
    needed("constant", probability=probability),
    needed("limited_range", probability=probability, max_range=positive),
    needed("limited_range", probability=probability, max_range=positive, outside=probability),
    needed("limited_sector", probability=probability, max_range=positive, half_width_deg=st.floats(0.1, 180.0)),
    needed(
        "soft_sector",
        probability=probability,
        max_range=positive,
        range_slope=positive,
        angle_slope=st.none() | positive,
        cut=st.booleans(),
    ),
    custom(),
)
MEASUREMENT_DIM = {"bearing_range": 2, "bearing_only": 1, "range_only": 1, "position": 2}


def platforms() -> st.SearchStrategy[Data]:
    moving = st.one_of(
        needed("still"),
        needed("courses", speed=zero_or_more, headings_deg=angles, relative=st.booleans()),
        needed("courses", speeds=st.lists(zero_or_more, min_size=1, max_size=3)),
        needed("steps", length=positive, speed=positive, stay=st.booleans()),
        needed("waypoints", points=st.lists(vector(2), min_size=1, max_size=3), speed=positive),
        custom(),
    )
    return moving | needed("camera", half_width_deg=st.floats(0.1, 180.0), pointings_deg=angles, carrier=moving)


@st.composite
def sensors(draw: st.DrawFn) -> Data:
    kind = draw(st.sampled_from(list(MEASUREMENT_DIM)))
    dim = MEASUREMENT_DIM[kind]
    grown = section(
        "range_dependent", sigma_range=positive, eta_range=zero_or_more, sigma_bearing_deg=st.floats(1e-9, 180.0)
    )
    by_axis = needed("by_axis", std=vector(2, positive), growth=vector(2, zero_or_more))
    angles = [st.floats(1e-9, 3.0)] if kind.startswith("bearing") else []
    stds = st.tuples(*angles, *[positive] * (dim - len(angles))).map(list)
    noises = [needed("constant", std=stds), custom(), by_axis if kind == "position" else grown]
    low = draw(vector(dim, st.floats(-3.0, 0.0)))  # of an angle and its high no further apart than a turn
    boxes = needed("measurement_space", rate=rates, low=st.just(low), high=vector(dim, st.floats(1.0, 3.0)))
    around = needed("around_sensor", radius=positive) | needed("around_sensor", rate=rates, half_side=positive)
    clutters = st.one_of(section("region", rate=rates), boxes, custom(), *([around] if dim == 2 else []))
    truth = section(noise=st.one_of(noises), detection=detections, clutter=clutters, first_detection=detections)
    fixed = {"position": draw(vector(2)), "measurement": {"kind": kind}, "noise": draw(st.one_of(noises))}
    optional = section(
        heading_deg=finite,
        platform=platforms(),
        moves_from=st.sampled_from(["first_decision", "start"]),
        detection=detections,
        clutter=clutters,
        truth=truth,
        scans=st.just({}) | st.just({"every": 3}),
    )
    return {**fixed, **draw(optional)}


def steps(last: int) -> st.SearchStrategy[list[int]]:
    return st.lists(st.integers(1, last), unique=True, max_size=4).map(sorted)


@st.composite
def targets(draw: st.DrawFn, dim: int, last: int) -> Data:
    tracks = []
    for _ in range(draw(st.integers(0, 3))):
        first, final = sorted(draw(st.tuples(st.integers(1, last), st.integers(1, last))))
        extent = section(
            start_step=st.just(first),
            end_step=st.just(final),
            process_noise=st.booleans(),
            std=st.none() | vector(dim, positive),
        )
        tracks.append({"state": draw(vector(dim)), **draw(extent)} | ({"end_step": final}))
    return {"kind": "scripted", "tracks": tracks}


def sites(dim: int) -> st.SearchStrategy[list[Data]]:
    diagonal = vector(dim, positive).map(lambda v: [[v[i] if i == j else 0.0 for j in range(dim)] for i in range(dim)])
    by_std = needed(existence=inner, mean=vector(dim), std=vector(dim, positive))
    by_cov = needed(existence=inner, mean=vector(dim), cov=diagonal)
    return st.lists(by_std | by_cov, min_size=1, max_size=3)


@st.composite
def tracking(draw: st.DrawFn, num_sensors: int) -> Data:
    without_labels = ("phd", "cphd", "cb_member") if num_sensors == 1 else ()
    kind = draw(st.sampled_from(["delta_glmb", "m_delta_glmb", "lmb", *without_labels]))
    gibbs = section("gibbs", num_samples=counts) if "glmb" in kind else st.just({"kind": "ranked"})
    limits = section(
        max_intensity_components=counts,
        max_existence=inner,
        max_hypotheses=counts,
        min_relative_weight=st.floats(0.0, 0.5),
        gate_probability=inner,
    )
    method, at = st.sampled_from(["auto", "ekf", "ukf", "ckf"]), st.sampled_from(["centre", "mean"])
    weights = [1.0 / num_sensors] * num_sensors
    fusion = section(
        weights=st.just(weights),
        mixture_power=st.sampled_from(["moment_matched", "component_wise", "quadrature"]),
        missing_weight=inner,
        missing_existence=inner,
        feedback=st.booleans(),
        limits=section(
            max_hypotheses=counts, max_components=st.integers(1, 4), merge_distance=st.none() | zero_or_more
        ),
    )
    marginal = section("marginal", threshold=inner)
    return {
        "filter": {
            "kind": kind,
            **draw(section(gaussian_method=method, detection_at=at, assignment=gibbs, limits=limits)),
        },
        "fusion": {"kind": {"lmb": "clmb"}.get(kind, "cm_delta_glmb" if "glmb" in kind else "none"), **draw(fusion)},
        "estimator": draw(st.just({"kind": "map"}) | marginal if "lmb" in kind else st.just({"kind": "map"})),
    }


def undetected(side: float) -> st.SearchStrategy[Data]:
    """side: of the region."""
    fixed = needed(cell=st.floats(side / 400.0, side * 2.0), expected=rates, speed=zero_or_more)
    more = section(birth_rate=rates, enters=st.sampled_from(["anywhere", "border"]), survival=probability)
    return st.builds(lambda one, other: {**one, **other}, fixed, more)


searches = st.one_of(
    section("automatic", max_joint_actions=counts),
    section("exhaustive", max_joint_actions=counts),
    section("coordinate_ascent", num_restarts=st.integers(0, 100)),
    section("sequential_greedy", order=st.sampled_from(["printed", "best_first"])),
    section("cross_entropy", num_samples=counts, elite_share=inner, smoothing=st.floats(0.1, 1.0), max_rounds=counts),
    custom(),
)


@st.composite
def constraints(draw: st.DrawFn) -> Data:
    x, y = draw(vector(2)), draw(vector(2, st.floats(1.0, 1e6)))
    region = st.just({"x_min": x[0], "x_max": x[0] + y[0], "y_min": x[1], "y_max": x[1] + y[1]})
    return draw(
        needed("stay_inside", region=region)
        | needed("keep_out", region=region)
        | needed("keep_out", polygon=st.lists(vector(2), min_size=3, max_size=5))
        | needed("separation", distance=positive)
        | needed("void_probability", radius=positive, probability=probability)
        | custom()
    )


@st.composite
def scenarios(draw: st.DrawFn) -> Data:
    """The data of a valid scenario file."""
    last, dim = draw(st.integers(1, 500)), draw(st.sampled_from(list(motions)))
    x, y = draw(vector(2)), draw(vector(2, st.floats(1.0, 1e6)))
    carried = draw(st.lists(sensors(), min_size=1, max_size=4))
    control = section(
        decision_steps=steps(last),
        horizon_steps=counts,
        horizon_period=positive,
        num_samples=counts,
        ideal_measurements=st.sampled_from(["ideal", "expected", "sampled"]),
        detection_threshold=probability,
        reward=section("cauchy_schwarz", unit_volume=st.just("reference") | positive)
        | section("renyi", order=positive.filter(lambda order: order != 1.0)),
        search=searches,
        constraints=st.lists(constraints(), max_size=3),
        lookahead=section(
            depth=st.integers(1, 100), method=st.just("beam"), beam_width=counts, budget=counts, discount=probability
        )
        | section(method=st.just("tree")),
        limits=section(max_prior_hypotheses=counts, max_hypotheses=counts),
    )
    followed, decided = draw(tracking(len(carried))), draw(control)
    if followed["filter"]["kind"] in ("phd", "cphd", "cb_member"):
        decided["constraints"] = [own for own in decided.get("constraints", []) if own["kind"] != "void_probability"]
        carried = [{**item, "scans": {}} for item in carried]
    elif decided.get("search", {}).get("kind") == "sequential_greedy":
        decided["limits"] = {"max_glmb_targets": 0}
    return {
        "name": draw(names),
        "description": draw(st.text(st.characters(exclude_categories=["Cs", "Cc"]), max_size=30)),
        "time": {"num_steps": last, **draw(section(step_period=st.floats(1e-3, 1e3), start=st.floats(-1e5, 1e5)))},
        "region": {"x_min": x[0], "x_max": x[0] + y[0], "y_min": x[1], "y_max": x[1] + y[1]},
        "motion": draw(motions[dim]),
        "survival": draw(section("constant", probability=probability) | custom()),
        "birth": {"sites": draw(sites(dim)), **draw(section(steps=st.just("every") | steps(last)))},
        "targets": draw(targets(dim, last)),
        "sensors": [{**item, "name": f"{draw(names)}{number}"} for number, item in enumerate(carried)],
        **followed,
        "control": decided,
        **draw(section(undetected=undetected(max(y)))),
        "ospa": draw(
            section(
                cutoff=positive,
                order=st.floats(1.0, 100.0),
                window=counts,
                from_step=st.just(1),
                to_step=st.just(last),
            )
        ),
    }
