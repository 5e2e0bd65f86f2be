"""A run as a video: targets, estimates, sensors and measurements scan by scan, as on the page of a report."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.patches import Circle, Ellipse
from numpy.typing import NDArray

from vedette.errors import InputError
from vedette.evaluation.figures.labels import drawn_text, short_label
from vedette.evaluation.figures.scene import build_scene, draw_field, draw_zones, place_names
from vedette.evaluation.figures.style import COLUMN_WIDTH, GREY, INK, colour, new_figure, styled
from vedette.evaluation.figures.tracks import (
    LARGE,
    SENSOR_MARKERS,
    add_legend,
    frame_tracks,
    labels_recur,
    plot_bounds,
    plot_extent,
)
from vedette.evaluation.recording_metadata import recording_metadata
from vedette.evaluation.scans import PLANE_SHAPES, available_scans, plane_coordinates
from vedette.evaluation.track_formats import utc_text
from vedette.internal.files import write_file
from vedette.internal.text import elided
from vedette.kernels.base.types import Floats
from vedette.scenarios import Scenario
from vedette.simulation import CLUTTER
from vedette.simulation.records import RunRecord
from vedette.simulation.scans import Scan

if TYPE_CHECKING:
    from matplotlib.animation import AbstractMovieWriter

ENDINGS = (".mp4", ".gif")
SCANS_PER_SECOND = 5.0
_SHORTEST, _LONGEST = 2.0, 60.0  # s, limits of the default length of a video
_MAX_FRAMES = {".mp4": 20_000, ".gif": 1000}  # all frames of a GIF are in memory at once
_SIGMAS = 2.0
_MAX_NAMED = 12  # largest number of estimates, targets or sensors with names


@styled
def write_video(
    record: RunRecord,
    scenario: Scenario,
    path: Path,
    *,
    fps: float = 10.0,
    seconds: float | None = None,
    size: int = 800,
    trust: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> int:
    """Write a run as a video, whole or not at all, and return the number of its frames.

    A frame shows the last scan at its time: true targets (rings) and their paths, estimates by label with their
    ellipses of two standard deviations, sensors with their fields of view and measurements. Measurements are those of
    `scans_of_record`. They are left out if they are not available.

    Args:
        record: the run.
        scenario: of the run.
        path: a file that ends with .mp4 (written by ffmpeg) or .gif.
        fps: frames per second.
        seconds: length. None: a fifth of a second for each scan, from two seconds to a minute.
        size: width in pixels.
        trust: run the code that the scenario names, to draw measurements.
        progress: called with the number of every frame drawn, and the number of all frames.

    Raises:
        InputError: another ending, too many frames, a file that cannot be written, or an ffmpeg that is missing or
            fails.
    """
    ending = path.suffix.lower()
    writer = _writer(ending, path, fps)
    if seconds is None:
        seconds = min(max(record.num_scans / SCANS_PER_SECOND, _SHORTEST), _LONGEST)
    num_frames = max(1, round(seconds * fps))
    if num_frames > _MAX_FRAMES[ending]:
        raise InputError(f"seconds: expected at most {_MAX_FRAMES[ending]} frames of a {ending} file; got {num_frames}")
    times = np.linspace(record.times[0], record.times[-1], num_frames) if num_frames > 1 else record.times[:1]
    steps = np.searchsorted(record.times, times, side="right") - 1
    drawing = _Drawing(record, scenario, trust)
    with tempfile.TemporaryDirectory(prefix="vedette-video-", ignore_cleanup_errors=True) as folder:
        partial = Path(folder) / f"video{ending}"
        try:
            with writer.saving(drawing.figure, str(partial), size / drawing.figure.get_figwidth()):
                for frame, step in enumerate(steps.tolist(), start=1):
                    drawing.show(step)
                    writer.grab_frame()
                    if progress is not None:
                        progress(frame, num_frames)
        except (subprocess.CalledProcessError, BrokenPipeError) as error:
            if isinstance(error.__context__, KeyboardInterrupt):  # the signal went to ffmpeg, too
                raise KeyboardInterrupt from None
            messages = str(getattr(error, "stderr", None) or error).strip().splitlines()[-1:]
            raise InputError(f"{path}: expected ffmpeg to write it; it failed: {' '.join(messages)}") from error
        except OSError as error:
            room = f"expected room in {folder} until the video is whole"
            raise InputError(f"{path}: {room}; {error.strerror or error}") from error
        with partial.open("rb") as video:
            write_file(path, lambda file: shutil.copyfileobj(video, file), make_folder=True)
    return num_frames


@styled
def scan_image(record: RunRecord, scenario: Scenario, *, size: int = 800) -> NDArray[np.uint8]:
    """Return an image of the last scan of a run, (height, size, 3) RGB, as a frame of `write_video` shows it."""
    drawing = _Drawing(record, scenario, trust=False)
    drawing.show(record.num_scans - 1)
    drawing.figure.set_dpi(size / drawing.figure.get_figwidth())
    canvas = FigureCanvasAgg(drawing.figure)
    canvas.draw()  # type: ignore[no-untyped-call]
    return np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[:, :, :3])  # type: ignore[no-untyped-call]


def _writer(ending: str, path: Path, fps: float) -> AbstractMovieWriter:
    from matplotlib.animation import FFMpegWriter, PillowWriter  # here, as no other figure needs it

    if ending not in ENDINGS:
        raise InputError(f"path: expected a file that ends with {' or '.join(ENDINGS)}; got {path}")
    if ending == ".gif":
        return PillowWriter(fps=fps)  # type: ignore[arg-type]
    if not FFMpegWriter.isAvailable():
        raise InputError(f"path: expected ffmpeg, which writes {path}; it is not installed (a .gif needs none)")
    return FFMpegWriter(fps=fps, metadata={"title": path.stem})  # type: ignore[arg-type]


class _Drawing:
    """A figure whose axes show one scan after another."""

    def __init__(self, record: RunRecord, scenario: Scenario, trust: bool) -> None:
        self._record, self._scenario = record, scenario
        self._scans = available_scans(record, scenario, trust)
        self._scene, self._metadata = build_scene(scenario, record.planner), recording_metadata(record, scenario)
        self._scale = 1e-3 if plot_extent([record]) > LARGE else 1.0
        self.figure = new_figure(COLUMN_WIDTH + 0.75)
        self.figure.set_layout_engine("constrained", h_pad=0.08)  # see `tracks_figure`
        self._axes: Axes = self.figure.subplots()
        self._axes.set_aspect("equal")
        draw_zones(self._axes, self._scene.zones, self._scale)
        frame_tracks(self._axes, [record], self._scale, self._scene)
        add_legend(self.figure, record, self._scene, is_video=True)
        labels = np.concatenate([estimate.labels for estimate in record.estimates])
        places = {tuple(label): place for place, label in enumerate(np.unique(labels, axis=0).tolist())}
        self._places: dict[tuple[int, ...], int] = places if labels_recur(labels) else {}
        self._shown: list[Artist] = []
        self._step = -1
        self.show(0)
        self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")  # the same layout in every frame

    def show(self, step: int) -> None:
        """Show a scan in place of the previous one."""
        if step == self._step:
            return
        for artist in self._shown:
            artist.remove()
        self._step, self._shown = step, []
        name = drawn_text(short_label(self._record.planner))
        time = float(self._record.times[step])
        clock = f"t = {time:.1f} s"
        if self._metadata.is_utc:
            utc = utc_text(time + self._metadata.start)
            clock = f"{utc[:10]} {utc[11:21]} UTC"
        self._axes.set_title(f"{name}, {drawn_text(self._record.source)}: {clock}")
        self._draw_sensors(step)
        self._draw_truth(step)
        self._draw_estimates(step)
        self._draw_names(step)

    def _add(self, artist: Artist) -> None:
        self._shown.append(artist)

    def _draw_truth(self, step: int) -> None:
        truth = self._record.truth
        end = int(truth.offsets[step + 1])
        ids, positions = truth.ids[:end], truth.states[:end, :2] * self._scale
        paths = [positions[ids == target] for target in np.unique(ids)]
        self._add(self._axes.add_collection(LineCollection(paths, colors=INK, linewidths=0.9, zorder=2)))
        ids, states = truth.at(step)
        style: dict[str, Any] = {"marker": "o", "color": INK, "markerfacecolor": "white", "markersize": 5}
        self._add(self._axes.plot(*(states[:, :2].T * self._scale), linestyle="", zorder=4, **style)[0])

    def _draw_estimates(self, step: int) -> None:
        estimates = self._record.estimates[: step + 1]
        points = np.concatenate([estimate.means[:, :2] for estimate in estimates]) * self._scale
        shades = [self._shade(label) for estimate in estimates for label in estimate.labels.tolist()]
        if shades:
            self._add(
                self._axes.scatter(points[:, 0], points[:, 1], s=2.5, c=shades, alpha=0.5, linewidths=0, zorder=3)
            )
        current = estimates[-1]
        for label, mean, cov in zip(current.labels.tolist(), current.means, current.covs, strict=True):
            shade, position = self._shade(label), (float(mean[0]) * self._scale, float(mean[1]) * self._scale)
            variances, axes = np.linalg.eigh(cov[:2, :2])
            width, height = 2.0 * _SIGMAS * np.sqrt(np.maximum(variances, 0.0)) * self._scale
            angle = float(np.degrees(np.arctan2(axes[1, 0], axes[0, 0])))
            ellipse = Ellipse(position, width, height, angle=angle, color=shade, fill=False, linewidth=0.8, zorder=5)
            self._add(self._axes.add_patch(ellipse))
            self._add(self._axes.plot(*position, marker=".", color=shade, markersize=5, zorder=6)[0])

    def _draw_names(self, step: int) -> None:
        """Draw names of sensors, targets and estimates, in this order. A name that would cover another is left out."""
        record, current = self._record, self._record.estimates[step]
        ids, states = record.truth.at(step)
        names = [(self._scene.name(s), pose[:2], INK) for s, pose in enumerate(record.poses[step])]
        if record.num_sensors > _MAX_NAMED:
            names = []
        if len(ids) <= _MAX_NAMED:
            targets = zip(ids.tolist(), states, strict=True)
            names += [
                (drawn_text(elided(self._metadata.names[target], 20)), state[:2], INK)
                for target, state in targets
                if target < len(self._metadata.names)
            ]
        if self._places and len(current.labels) <= _MAX_NAMED:
            estimates = zip(current.labels.tolist(), current.means, strict=True)
            names += [(".".join(map(str, label)), mean[:2], self._shade(label)) for label, mean in estimates]
        if not names:
            return
        marks = np.concatenate([states[:, :2], current.means[:, :2], record.poses[step, :, :2]])
        positions = np.array([position for _, position, _ in names])
        name_places = place_names([name for name, *_ in names], positions, plot_bounds([record], self._scene), marks)
        for (name, _, shade), position, (arguments, covers_name) in zip(
            names, positions * self._scale, name_places, strict=True
        ):
            style: dict[str, Any] = {"textcoords": "offset points", "fontsize": 6, "color": shade, "zorder": 9}
            if not covers_name:
                self._add(self._axes.annotate(name, (float(position[0]), float(position[1])), **arguments, **style))

    def _shade(self, label: list[int]) -> str:
        return colour(self._places.get(tuple(label), 0))

    def _draw_sensors(self, step: int) -> None:
        record, model = self._record, self._scenario.model
        for s, (section, pose) in enumerate(zip(model.sensors, record.poses[step], strict=True)):
            position = (float(pose[0]) * self._scale, float(pose[1]) * self._scale)
            field = self._scene.field(s, pose)
            if field is not None:
                self._add(draw_field(self._axes, position, field, self._scale))
            path = record.poses[: step + 1, s, :2] * self._scale
            self._add(self._axes.plot(*path.T, color=GREY, linewidth=1.2, linestyle=(0, (2.5, 1)), zorder=3)[0])
            marker = SENSOR_MARKERS[s % len(SENSOR_MARKERS)]
            style: dict[str, Any] = {"marker": marker, "color": INK, "markerfacecolor": GREY, "markersize": 6}
            self._add(self._axes.plot(*position, zorder=8, **style)[0])
            scan = self._scans[step][s] if self._scans else None
            if scan is not None and section.measurement.kind in PLANE_SHAPES:
                self._draw_scan(scan, section.measurement.kind, pose)

    def _draw_scan(self, scan: Scan, kind: str, pose: Floats) -> None:
        """Draw crosses, rays or circles: measurements of targets in dark ink, clutter in grey."""
        positions = plane_coordinates(scan.measurements, kind, pose) * (
            1.0 if PLANE_SHAPES[kind] == "ray" else self._scale
        )
        for is_clutter in (False, True):
            shown = positions[(scan.origins == CLUTTER) == is_clutter]
            style: dict[str, Any] = {"color": GREY if is_clutter else INK, "alpha": 0.7, "zorder": 2.5}
            origin = pose[:2] * self._scale
            if PLANE_SHAPES[kind] == "ray":
                ends = origin + 2.0 * plot_extent([self._record]) * self._scale * np.column_stack(
                    [np.cos(shown), np.sin(shown)]
                )
                rays = [np.stack([origin, end]) for end in ends]
                self._add(self._axes.add_collection(LineCollection(rays, linewidths=0.5, **style), autolim=False))
            elif PLANE_SHAPES[kind] == "circle":
                for radius in shown[:, 0].tolist():
                    circle = Circle((float(origin[0]), float(origin[1])), max(radius, 0.0), fill=False, lw=0.5, **style)
                    self._add(self._axes.add_patch(circle))
            else:
                size = 2.5 if is_clutter else 4.0
                self._add(self._axes.plot(*shown.T, linestyle="", marker="x", markersize=size, mew=0.7, **style)[0])
