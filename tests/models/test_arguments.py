"""Checks of arguments."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vedette.errors import InputError
from vedette.filters import PredictUpdateFilter
from vedette.models.arguments import instance, provides
from vedette.platforms import HeadingPlatform, Operated, Stationary
from vedette.platforms.base import HasPrices, HasScans, Platform, SupportsManyActions

PROTOCOLS = (Platform, SupportsManyActions, HasPrices, HasScans, PredictUpdateFilter)


class Loose:
    """A class whose objects differ in what they have."""

    def __init__(self, **members: Any) -> None:
        self.__dict__.update(members)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_provides_is_isinstance_of_a_protocol(protocol: Any) -> None:
    objects = [
        HeadingPlatform(50.0),
        Stationary(),
        Operated(HeadingPlatform(50.0), 1.0),
        np.zeros(3),
        SimpleNamespace(),
        None,
    ]
    objects += [Loose(prices=len), Loose(), Loose(prices=None), SimpleNamespace(scans=len, courses=len)]
    for each in objects:
        assert provides(each, protocol) == isinstance(each, protocol), each


def test_an_object_that_lacks_a_member_is_refused() -> None:
    instance("platform", HeadingPlatform(50.0), Platform)
    with pytest.raises(InputError, match="platform: expected a Platform; got Loose"):
        instance("platform", Loose(columns=()), Platform)
