"""Tests of a sensor's detections and false measurements by range and by sector."""

from collections.abc import Iterator

import numpy as np

from vedette.evaluation.block_means import BLOCK, BlockMean, mean_of
from vedette.evaluation.innovations import SensorFit
from vedette.kernels.base.types import Bools, Floats
from vedette.models.sensor import SensorModel

LEAST_EXCESS = 0.5  # unexplained measurements a scan above the expected number; and as a share of the clutter rate
_LEAST_DIFFERENCE = 0.2  # between the shares of detected targets inside and outside
_SECTOR, _MOST_SECTORS = 30, 5  # deg; and number of neighbouring ones in one place
_RANGES = np.arange(1, 8) / 8.0  # share of the positions that are nearer
_SAMPLES = 200  # of clutter, for its share in a place; and scans of it that are drawn at most


def detection_by_place(offsets: Floats, made: Floats, likely: Floats, compass: bool) -> str | None:
    """Return in words where detections differ from the expected ones other than elsewhere, or None if nowhere.

    offsets: (num_blocks, 2) mean positions relative to the sensor of blocks of successive scans of a track, m. made,
    likely: (num_blocks, 2) sums and numbers of detections, and of their probabilities. compass: whether directions
    count clockwise from north.
    """
    if not len(offsets):
        return None
    excess = np.column_stack([made[:, 0] - likely[:, 0], made[:, 1]])
    found = []
    for words, inside in _places(offsets, np.quantile(np.hypot(*offsets.T), _RANGES), compass):
        difference = mean_of(excess[inside]).minus(mean_of(excess[~inside]))
        if difference.is_surely(0.0, _LEAST_DIFFERENCE):
            found.append((difference.away_from(0.0), words, inside))
    if not found:
        return None
    _, words, inside = max(found, key=lambda each: each[0])
    shares = [mean_of(made[own]).value for own in (inside, ~inside)]
    return (
        f"detects its tracks in {shares[0]:.0%} of scans {words} ({likely[inside, 0].sum():.0f} detections expected), "
        f"in {shares[1]:.0%} elsewhere: give `detection` a range or a field of view"
    )


def clutter_by_place(fit: SensorFit, sensor: SensorModel, state_dim: int, compass: bool) -> str | None:
    """Return in words where more measurements are unexplained than clutter explains, or None if nowhere.

    state_dim: of the targets. compass: as in `detection_by_place`.
    """
    num_scans, least = len(fit.counts), LEAST_EXCESS * max(1.0, sensor.clutter.rate)
    if len(fit.unexplained) <= least * num_scans or sensor.clutter.sampler is None or np.isnan(fit.unexplained).any():
        return None
    drawn = _drawn_clutter(fit, sensor, state_dim)
    block = np.repeat(np.arange(num_scans) // BLOCK, fit.counts)
    sizes = np.bincount(np.arange(num_scans) // BLOCK)
    totals = np.bincount(block, minlength=len(sizes))
    limits = np.quantile(np.hypot(*fit.unexplained.T), _RANGES)
    found = list[tuple[BlockMean, str, float, float]]()
    places = zip(_places(fit.unexplained, limits, compass), _places(drawn, limits, compass), strict=True)
    for (words, inside), (_, is_drawn) in places:
        share = float(is_drawn.mean()) if len(drawn) else 0.0
        sums = np.bincount(block[inside], minlength=len(sizes)) - share * totals
        excess = mean_of(np.column_stack([sums, sizes]))
        if excess.value > 0.0 and excess.is_surely(0.0, least):
            found.append((excess, words, float(inside.mean()), share))
    if not found:
        return None
    _, words, part, share = max(found, key=lambda each: each[0].value)
    return (
        f"{part:.0%} of its unexplained measurements lie {words}, where its clutter has {share:.0%}: if they are of "
        "land or of the own ship, `recording: {ignore: stationary}` leaves them out"
    )


def _drawn_clutter(fit: SensorFit, sensor: SensorModel, state_dim: int) -> Floats:
    """Return positions of clutter that is drawn from the model, relative to the sensor, (num, 2) m."""
    rng, scans, num = np.random.default_rng(0), list[Floats](), 0
    while num < _SAMPLES and len(scans) < _SAMPLES:
        scans.append(sensor.clutter.sample(fit.pose, sensor.measurement, state_dim=state_dim, rng=rng))
        num += len(scans[-1])
    return np.asarray(sensor.measurement.positions(np.concatenate(scans), fit.pose) - fit.pose[:2])


def _places(offsets: Floats, limits: Floats, compass: bool) -> Iterator[tuple[str, Bools]]:
    """Yield places in words, and which positions relative to the sensor, (num, 2) m, lie there.

    Places are beyond one of the limits, m, or sectors.
    """
    distances = np.hypot(*offsets.T)
    for limit in limits.tolist():
        yield f"beyond {limit / 1000.0:.2g} km" if limit >= 5000.0 else f"beyond {limit:.0f} m", distances > limit
    angles = np.degrees(np.arctan2(offsets[:, 1], offsets[:, 0]))
    sectors, num = ((90.0 - angles if compass else angles) % 360.0) // _SECTOR, 360 // _SECTOR
    quantity = "bearings" if compass else "angles (anticlockwise from east)"
    for first in range(num):
        for width in range(1, _MOST_SECTORS + 1):
            words = f"within {quantity} {_SECTOR * first} to {_SECTOR * ((first + width - 1) % num + 1)} deg"
            yield words, (sectors - first) % num < width
