"""The paper's figures, drawn with Matplotlib objects alone: no display, no global state.

Every function returns a `matplotlib.figure.Figure`; `save_figure` writes it as PDF, SVG and PNG.
"""

from vedette.evaluation.figures.ospa import ospa_figure
from vedette.evaluation.figures.rewards import reward_figure
from vedette.evaluation.figures.style import save_figure
from vedette.evaluation.figures.tracks import overview_figure, tracks_figure

__all__ = ["ospa_figure", "overview_figure", "reward_figure", "save_figure", "tracks_figure"]
