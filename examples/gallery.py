"""One picture of all scenes in all weathers: ``python examples/gallery.py [gallery.png] [--width 480]``."""

from __future__ import annotations

import argparse
import math
from importlib import import_module
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from rich.progress import track

from belie.geometry import CameraModel
from belie.simulation.renderer import Renderer
from belie.simulation.weather import WEATHERS
from belie.simulation.world import World

ROWS = (
    ("street", "straight", 3.0),
    ("street", "curve", 5.0),
    ("street", "highway", 4.0),
    ("corridor", "straight", 4.0),
    ("flight", "curve", 5.0),
    ("patch", "straight", 7.0),
)
_FIELD_OF_VIEW_DEG = 80.0
Picture = npt.NDArray[np.uint8]


def main() -> None:
    """Render the gallery."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", nargs="?", type=Path, default=Path("gallery.png"))
    parser.add_argument("--width", type=int, default=480, help="of one picture [px]")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--weathers", default=",".join(WEATHERS), help="some of them, by comma")
    options = parser.parse_args()
    width = options.width
    height, names = round(width * 9 / 16), options.weathers.split(",")
    focal = 0.5 * width / math.tan(math.radians(0.5 * _FIELD_OF_VIEW_DEG))
    camera = CameraModel(
        width=width, height=height, fx=focal, fy=focal, cx=0.5 * width - 0.5, cy=0.5 * height - 0.5
    )
    rows = []
    for scene, manoeuvre, t_s in track(ROWS, description="scenes"):
        world = import_module(f"belie.simulation.scenes.{scene}").build(
            seed=options.seed, manoeuvre=manoeuvre, duration_s=15.0
        )
        rows.append(np.hstack([picture(world, camera, name, options.seed, t_s) for name in names]))
    cv2.imwrite(str(options.out), np.vstack(rows))
    print(f"{options.out}: {len(ROWS)} scenes (rows) in {', '.join(names)} (columns)")


def picture(world: World, camera: CameraModel, weather: str, seed: int, t_s: float) -> Picture:
    """One scene in one weather, with its name."""
    with Renderer(world, camera, WEATHERS[weather], seed) as renderer:
        image = renderer.render(t_s, with_truth=False).bgr
    (across, _), _ = cv2.getTextSize(weather, cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)
    image[:24, : across + 16] //= 3
    cv2.putText(image, weather, (8, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1, cv2.LINE_AA)
    return image


if __name__ == "__main__":
    main()
