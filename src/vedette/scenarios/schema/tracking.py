"""Sections about tracking: the local filters, the fusion of their densities, the estimates and their score."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from vedette.scenarios.schema.base import Positive, Probability, Section, Whole

Count = Annotated[Whole, Field(ge=1, le=1_000_000_000)]


class RankedAssignment(Section):
    """The best associations of each hypothesis, in order (exact)."""

    kind: Literal["ranked"] = Field(default="ranked", description="Kind of truncation [-].")


class GibbsAssignment(Section):
    """Associations drawn by a Gibbs sampler; for scenes too busy to rank."""

    kind: Literal["gibbs"] = Field(default="gibbs", description="Kind of truncation [-].")
    num_samples: Count = Field(default=1000, description="Number of draws a scan, over all hypotheses [-].")


Assignment = Annotated[RankedAssignment | GibbsAssignment, Field(discriminator="kind")]


Share = Annotated[float, Field(ge=0.0, lt=1.0)]


class FilterLimits(Section):
    """Caps and thresholds of a filter: what it throws away, and so what it costs."""

    max_hypotheses: Count = Field(default=300, description="Most hypotheses kept after a scan [-].")
    min_relative_weight: Share = Field(
        default=1e-6,
        description="Hypotheses (of a cphd: large numbers of targets) lighter than this times the heaviest are dropped "
        "[-].",
    )
    min_track_weight: Annotated[float, Field(ge=0.0, le=1.0)] = Field(
        default=1e-5,
        description="Each label's heaviest hypothesis is kept unless lighter than this times the heaviest of all [-].",
    )
    gate_probability: Annotated[float, Field(gt=0.0, le=1.0)] = Field(
        default=1.0 - 1e-7, description="Probability that a target's measurement falls in its gate; 1: no gate [-]."
    )
    min_log_clutter: float = Field(
        default=-60.0, description="Floor of the log clutter intensity, for places where clutter is impossible [-]."
    )
    max_search_nodes: Count = Field(default=1_000_000, description="Bound on the ranking search [-].")
    min_component_weight: Share = Field(
        default=1e-5, description="Components lighter than this share of their track or intensity are dropped [-]."
    )
    merge_distance: float = Field(
        default=2.0, ge=0.0, description="Mahalanobis distance within which components are merged; 0: never [-]."
    )
    max_components: Count = Field(default=10, description="Most Gaussian components of a track [-].")
    min_existence: Share = Field(
        default=1e-4, description="LMB tracks and Bernoullis less probable than this are dropped [-]."
    )
    max_labels: Count = Field(default=200, description="Most tracks of an LMB, Bernoullis of a cb_member [-].")
    max_intensity_components: Count = Field(
        default=100, description="Most Gaussian components of the intensity of a phd or cphd, all targets together [-]."
    )
    max_existence: Annotated[float, Field(gt=0.0, lt=1.0)] = Field(
        default=0.999, description="Bernoullis of a cb_member surer than this are taken as this sure [-]."
    )


# Filters that keep no identity of their targets.
UNLABELLED = ("phd", "cphd", "cb_member")

GaussianMethod = Literal["auto", "ekf", "ukf", "ckf"]


class Filter(Section):
    """The filter that every sensor runs on its own scans."""

    kind: Literal["delta_glmb", "m_delta_glmb", "lmb", "phd", "cphd", "cb_member"] = Field(
        default="m_delta_glmb",
        description="delta-GLMB; delta-GLMB marginalised after each scan (one component a label set); LMB; or, without "
        "labels and for a single sensor that nobody steers by its density: PHD, CPHD, cardinality-balanced "
        "multi-Bernoulli [-].",
    )
    gaussian_method: GaussianMethod = Field(
        default="auto", description="Extended, unscented or cubature Kalman; auto: extended where Jacobians exist [-]."
    )
    assignment: Assignment = Field(default=RankedAssignment(), description="How associations are truncated [-].")
    limits: FilterLimits = Field(default=FilterLimits(), description="What is thrown away [-].")


Weights = Annotated[tuple[Probability, ...], Field(strict=False, min_length=1)]
Floor = Annotated[float, Field(gt=0.0, lt=1.0)]


class FusionLimits(Section):
    """Caps on the cost of a fusion."""

    max_hypotheses: Count = Field(default=1000, description="Most label sets of the fused density [-].")
    max_components: Count = Field(
        default=4, description="Most components of a track before its power is taken; unused when moment matched [-]."
    )
    min_component_weight: Annotated[float, Field(gt=0.0, lt=1.0)] = Field(
        default=1e-5, description="Lighter components are dropped; unused when moment matched [-]."
    )
    merge_distance: Annotated[float, Field(ge=0.0)] | None = Field(
        default=None,
        description="Closer components are merged; none: 2 for component_wise, 0.5 for quadrature powers [-].",
    )
    max_combinations: Count = Field(
        default=4096, description="Bound on the combinations of components of one label at all sensors [-]."
    )


class Fusion(Section):
    """How the sensors' densities become one: generalised covariance intersection (paper section II-D)."""

    kind: Literal["cm_delta_glmb", "clmb", "none"] = Field(
        default="cm_delta_glmb",
        description="Of marginalised delta-GLMB densities, of LMB densities, or none (a single sensor) [-].",
    )
    weights: Weights | None = Field(
        default=None, description="Weight of each sensor, with sum 1; none: equal weights [-]."
    )
    mixture_power: Literal["moment_matched", "component_wise", "quadrature"] = Field(
        default="moment_matched",
        description="Power of a Gaussian mixture: of the Gaussian with its moments; of each component, which is valid "
        "for well separated ones; or the latter corrected by cubature [-].",
    )
    missing_weight: Floor = Field(
        default=1e-6, description="Weight of a label set where a sensor lost it by truncation (cm_delta_glmb) [-]."
    )
    missing_existence: Floor = Field(
        default=1e-4, description="Existence of a label where a sensor lost it by truncation (clmb) [-]."
    )
    feedback: bool = Field(
        default=False, description="Whether the fused density replaces the sensors' own; the paper's does not [-]."
    )
    limits: FusionLimits = Field(default=FusionLimits(), description="What is thrown away [-].")


class MapEstimator(Section):
    """Most probable number of targets, then the best hypothesis with that number (as in the paper). Of a filter without
    labels, the heaviest components or Bernoullis instead, newly labelled at each scan; a phd's number is the mean."""

    kind: Literal["map"] = Field(default="map", description="Kind of estimate [-].")


class MarginalEstimator(Section):
    """Every label whose existence is probable enough; for filters that have labels."""

    kind: Literal["marginal"] = Field(default="marginal", description="Kind of estimate [-].")
    threshold: Annotated[float, Field(gt=0.0, lt=1.0)] = Field(
        default=0.5, description="Least probability of existence [-]."
    )


Estimator = Annotated[MapEstimator | MarginalEstimator, Field(discriminator="kind")]


class Ospa(Section):
    """The score: optimal subpattern assignment distance between estimates and truth, in position."""

    cutoff: Positive = Field(default=100.0, description="Cost of a missed or false target, c [m].")
    order: float = Field(default=1.0, ge=1.0, description="Order p [-].")
    window: Count = Field(default=10, description="Scans of the window of OSPA(2) [-].")
    from_step: Count | None = Field(
        default=None, description="First scan of the reported mean; none: the one after the first decision, or 1 [-]."
    )
    to_step: Count | None = Field(default=None, description="Last scan of the reported mean; none: the last scan [-].")
