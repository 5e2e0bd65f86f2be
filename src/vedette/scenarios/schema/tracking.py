"""Sections about tracking: the local filters, the fusion of their densities, the estimates and their score."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from vedette.scenarios.schema.base import Probability, Section, Whole

Count = Annotated[Whole, Field(ge=1)]


class RankedAssignment(Section):
    """The best associations of each hypothesis, in order (exact)."""

    kind: Literal["ranked"] = Field(default="ranked", description="Kind of truncation [-].")


class GibbsAssignment(Section):
    """Associations drawn by a Gibbs sampler; for scenes too busy to rank."""

    kind: Literal["gibbs"] = Field(default="gibbs", description="Kind of truncation [-].")
    num_samples: Count = Field(default=1000, description="Number of draws a scan, over all hypotheses [-].")


Assignment = Annotated[RankedAssignment | GibbsAssignment, Field(discriminator="kind")]


class Limits(Section):
    """What a filter throws away, and so how much it costs."""

    max_hypotheses: Count = Field(default=100, description="Most hypotheses kept after a scan [-].")
    min_hypothesis_weight: Annotated[float, Field(ge=0.0, lt=1.0)] = Field(
        default=1e-5, description="A hypothesis lighter than this is dropped [-]."
    )
    gate_probability: Annotated[float, Field(gt=0.0, le=1.0)] = Field(
        default=0.99999, description="Probability that a target's measurement falls in its gate; 1: no gate [-]."
    )
    max_tracks: Count = Field(default=200, description="Most tracks kept after a scan [-].")
    min_existence: Annotated[float, Field(ge=0.0, lt=1.0)] = Field(
        default=1e-4, description="An LMB track less probable than this is dropped [-]."
    )
    max_components: Count = Field(default=10, description="Most Gaussian components of a track [-].")
    min_component_weight: Annotated[float, Field(ge=0.0, lt=1.0)] = Field(
        default=1e-5, description="A component lighter than this is dropped [-]."
    )
    merge_distance: float = Field(
        default=2.0, ge=0.0, description="Components closer than this Mahalanobis distance are merged; 0: never [-]."
    )


class Filter(Section):
    """The filter that every sensor runs on its own scans."""

    kind: Literal["delta_glmb", "m_delta_glmb", "lmb"] = Field(
        default="m_delta_glmb",
        description="delta-GLMB; delta-GLMB marginalised after each scan (one component a label set); or LMB [-].",
    )
    gaussian_method: Literal["auto", "ekf", "ukf", "ckf"] = Field(
        default="auto", description="Extended, unscented or cubature Kalman; auto: extended where Jacobians exist [-]."
    )
    assignment: Assignment = Field(default=RankedAssignment(), description="How associations are truncated [-].")
    limits: Limits = Field(default=Limits(), description="What is thrown away [-].")


Weights = Annotated[tuple[Probability, ...], Field(strict=False, min_length=1)]


class Fusion(Section):
    """How the sensors' densities become one."""

    kind: Literal["cm_delta_glmb", "clmb", "none"] = Field(
        default="cm_delta_glmb",
        description="Generalised covariance intersection of marginalised delta-GLMB or of LMB densities, or none [-].",
    )
    weights: Weights | None = Field(
        default=None, description="Weight of each sensor, with sum 1; none: equal weights [-]."
    )
    mixture_power: Literal["component", "moment_matched"] = Field(
        default="component",
        description="Power of a Gaussian mixture: of each component, or of the single Gaussian with its moments [-].",
    )
    missing_weight: Annotated[float, Field(ge=0.0, lt=1.0)] = Field(
        default=1e-10,
        description="Weight given to a label set that one sensor lost by truncation and another kept [-].",
    )
    feedback: bool = Field(
        default=False, description="Whether the fused density replaces the sensors' own; the paper does not [-]."
    )


class MapEstimator(Section):
    """Most probable number of targets, then the best hypothesis with that number (as in the paper)."""

    kind: Literal["map"] = Field(default="map", description="Kind of estimate [-].")


class MarginalEstimator(Section):
    """Every label whose existence is probable enough."""

    kind: Literal["marginal"] = Field(default="marginal", description="Kind of estimate [-].")
    threshold: Annotated[float, Field(gt=0.0, lt=1.0)] = Field(
        default=0.5, description="Least probability of existence [-]."
    )


Estimator = Annotated[MapEstimator | MarginalEstimator, Field(discriminator="kind")]


class Ospa(Section):
    """The score: optimal subpattern assignment distance between estimates and truth, in position."""

    cutoff: float = Field(default=100.0, gt=0.0, description="Cost of a missed or false target, c [m].")
    order: float = Field(default=1.0, ge=1.0, description="Order p [-].")
    from_step: Count | None = Field(
        default=None, description="First scan of the reported mean; none: the one after the first decision, or 1 [-]."
    )
    to_step: Count | None = Field(default=None, description="Last scan of the reported mean; none: the last scan [-].")
