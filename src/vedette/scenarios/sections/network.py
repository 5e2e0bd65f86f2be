"""The radio network that sensors send their scans or beliefs over."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from vedette.scenarios.faults import Finding, describe
from vedette.scenarios.sections.base import Count, Positive, Section, Share, Whole, check

if TYPE_CHECKING:  # with the trackers comes the compiler, which a check does without
    from vedette.tracking import Network


class NetworkSection(Section):
    """Who hears whom: messages are passed on from sensor to sensor, and each goes on from what it has heard."""

    radio_range: Positive | None = Field(
        default=None, description="Distance up to which sensors hear each other; none: any [m]."
    )
    hops: Count | None = Field(
        default=None, description="Links that a message may travel; none: as far as they reach [-]."
    )
    loss: Share = Field(default=0.0, description="Probability that a link fails at a scan [-].")
    delay: Annotated[Whole, Field(ge=0, le=1000)] = Field(
        default=0, description="Scans that a message takes for each link [-]."
    )
    consensus_rounds: Count | None = Field(
        default=None,
        description="Rounds of averaging with the neighbours after each scan, instead of passing messages on; for "
        "fusions of densities; none: no consensus [-].",
    )

    @check
    def _consensus_is_at_once(self) -> Iterator[Finding]:
        for name in ("hops", "delay"):
            if self.consensus_rounds is not None and getattr(self, name):
                yield (name,), "none with consensus_rounds", describe(getattr(self, name))

    def build(self) -> Network:
        """The network."""
        from vedette.tracking import Network

        reach = float("inf") if self.radio_range is None else self.radio_range
        return Network(reach, self.hops, self.loss, self.delay, self.consensus_rounds)
