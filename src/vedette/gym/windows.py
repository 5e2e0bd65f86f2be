"""A window that shows pictures."""

import numpy as np
from numpy.typing import NDArray


class Window:
    """A window for a sequence of pictures, if there is a display."""

    def __init__(self) -> None:
        import matplotlib.pyplot as plt  # needs a display

        self._plt = plt
        plt.ion()
        self._figure = plt.figure("Vedette", frameon=False)

    def show(self, image: NDArray[np.uint8]) -> None:
        """Replace the picture."""
        self._figure.clear()
        axes = self._figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.imshow(image)
        axes.set_axis_off()
        self._figure.canvas.draw()
        self._figure.canvas.flush_events()

    def close(self) -> None:
        """Close the window."""
        self._plt.close(self._figure)
