"""The paper's figures, drawn only with Matplotlib objects: no display, no global state.

Every function returns a `matplotlib.figure.Figure`. `save_figure` writes it as PDF, SVG and PNG.
`write_video` shows a run scan by scan.
"""

from vedette.internal.extras import require_packages

require_packages("a figure", "matplotlib")

from vedette.evaluation.figures.consistency import consistency_figure
from vedette.evaluation.figures.cost import cost_figure
from vedette.evaluation.figures.distributions import distributions_figure
from vedette.evaluation.figures.mean_rewards import mean_rewards_figure
from vedette.evaluation.figures.ospa import differences_figure, ospa_figure
from vedette.evaluation.figures.rewards import reward_figure
from vedette.evaluation.figures.roses import roses_figure
from vedette.evaluation.figures.scene import Scene, build_scene
from vedette.evaluation.figures.style import png_bytes, save_figure, svg_text
from vedette.evaluation.figures.sweep import SweepCurve, sweep_figure
from vedette.evaluation.figures.tracks import overview_figure, tracks_figure
from vedette.evaluation.figures.video import scan_image, write_video

__all__ = [
    "Scene",
    "SweepCurve",
    "build_scene",
    "consistency_figure",
    "cost_figure",
    "differences_figure",
    "distributions_figure",
    "mean_rewards_figure",
    "ospa_figure",
    "overview_figure",
    "png_bytes",
    "reward_figure",
    "roses_figure",
    "save_figure",
    "scan_image",
    "svg_text",
    "sweep_figure",
    "tracks_figure",
    "write_video",
]
