"""Section about the search of joint actions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vedette.scenarios.sections.derived import Part, one_of

if TYPE_CHECKING:
    AnySearch = Part
else:
    AnySearch = one_of("search", "control/search", "vedette.control:JointSearch")
