"""The radio network over which sensors send their scans or beliefs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.base import Whole, check
from vedette.scenarios.sections.derived import Part, derived


@derived("vedette.tracking.network:Network")
class NetworkSection(Part):
    """Who hears whom: messages are passed on from sensor to sensor, and each goes on from what it has heard."""

    delay: Annotated[Whole, Field(ge=0, le=1000)]

    @check
    def _consensus_is_at_once(self) -> Iterator[Finding]:
        for name in ("max_hops", "delay"):
            if self.consensus_rounds is not None and getattr(self, name):
                yield (name,), "none with consensus_rounds", describe(getattr(self, name))
