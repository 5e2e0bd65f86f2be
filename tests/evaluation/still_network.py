"""A radar that stands still and two boats that decide, all with names, and zones that they may not enter or leave."""

from __future__ import annotations

from typing import Any

NAMES = ("Harbour radar", "Boat Anna", "Boat Bertha")
POLYGON = [[-300.0, 400.0], [300.0, 500.0], [200.0, 800.0], [-200.0, 700.0]]
_SENSOR: dict[str, Any] = {
    "measurement": {"kind": "bearing_range"},
    "noise": {"kind": "constant", "std": [0.01, 5.0]},
    "detection": {"kind": "constant", "probability": 0.95},
    "clutter": {"kind": "region", "rate": 3.0},
}
_BOAT: dict[str, Any] = {**_SENSOR, "platform": {"kind": "heading", "speed": 8.0}}
# Fields to set in `paper-a`. Bertha can only go where she does not leave the rectangle.
STILL_NETWORK: dict[str, Any] = {
    "time.num_steps": 13,
    "ospa.first_scan": 1,
    "ospa.last_scan": 13,
    "filter.kind": "lmb",
    "fusion": {"kind": "sequential"},
    "sensors": [
        {**_SENSOR, "name": NAMES[0], "position": [0.0, -900.0], "heading_deg": 90.0},
        {**_BOAT, "name": NAMES[1], "position": [-800.0, 700.0], "heading_deg": 0.0},
        {**_BOAT, "name": NAMES[2], "position": [940.0, -700.0], "heading_deg": 180.0},
    ],
    "control.decision_steps": [5, 10],
    "control.reward": {"kind": "expected_loss"},
    "control.constraints": [
        {"kind": "keep_out", "polygon": POLYGON},
        {"kind": "stay_inside", "region": {"x_min": -950.0, "x_max": 950.0, "y_min": -950.0, "y_max": 950.0}},
    ],
}
