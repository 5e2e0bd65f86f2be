"""Geodesics of the ellipsoid (WGS 84) by Vincenty's formulae, in plain Python."""

from __future__ import annotations

import math

RADIUS, FLATTENING = 6378137.0, 1.0 / 298.257223563
POLAR = RADIUS * (1.0 - FLATTENING)


def inverse(first: tuple[float, float], second: tuple[float, float]) -> tuple[float, float]:
    """Distance, m, and azimuth at the first of two points, rad; points are (longitude, latitude) in degrees."""
    off = math.radians(second[0] - first[0])
    one, two = (math.atan((1.0 - FLATTENING) * math.tan(math.radians(lat))) for lat in (first[1], second[1]))
    turn = off
    for _ in range(200):
        sine = math.hypot(
            math.cos(two) * math.sin(turn),
            math.cos(one) * math.sin(two) - math.sin(one) * math.cos(two) * math.cos(turn),
        )
        cosine = math.sin(one) * math.sin(two) + math.cos(one) * math.cos(two) * math.cos(turn)
        arc = math.atan2(sine, cosine)
        across = math.cos(one) * math.cos(two) * math.sin(turn) / sine
        rest = 1.0 - across**2
        middle = cosine - 2.0 * math.sin(one) * math.sin(two) / rest if rest > 0.0 else 0.0
        share = FLATTENING / 16.0 * rest * (4.0 + FLATTENING * (4.0 - 3.0 * rest))
        bent = arc + share * sine * (middle + share * cosine * (2.0 * middle**2 - 1.0))
        before, turn = turn, off + (1.0 - share) * FLATTENING * across * bent
        if abs(turn - before) < 1e-14:
            break
    square = rest * (RADIUS**2 - POLAR**2) / POLAR**2
    scale = 1.0 + square / 16384.0 * (4096.0 + square * (-768.0 + square * (320.0 - 175.0 * square)))
    part = square / 1024.0 * (256.0 + square * (-128.0 + square * (74.0 - 47.0 * square)))
    last = part / 6.0 * middle * (4.0 * sine**2 - 3.0) * (4.0 * middle**2 - 3.0)
    less = part * sine * (middle + part / 4.0 * (cosine * (2.0 * middle**2 - 1.0) - last))
    azimuth = math.atan2(
        math.cos(two) * math.sin(turn), math.cos(one) * math.sin(two) - math.sin(one) * math.cos(two) * math.cos(turn)
    )
    return POLAR * scale * (arc - less), azimuth
