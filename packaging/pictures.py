"""Make the pictures of the README: ``python packaging/pictures.py``, with the package and a Chromium installed.

It collects `configs/wide.yaml`, `ur5.yaml` and `quickstart.yaml` into a temporary directory, which takes some minutes,
and writes ``docs/pictures/throw.webp``, ``ur5.webp``, ``landing-map.webp`` and ``report.webp``.
"""

from __future__ import annotations

import base64
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

import throwcollect
from throwcollect.publish.view.animation import render

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs" / "pictures"
WIDTH = 900
MAP = """
(() => {
  const { data, layout } = JSON.parse(document.getElementById("landing-map-data").textContent);
  const { template } = document.getElementById("landing-map").layout;
  const traces = data.map((trace) => ({ ...trace, marker: { ...trace.marker, size: trace.name ? 12 : 4 } }));
  const { coloraxis, xaxis, yaxis } = layout;
  const title = { text: "release speed [m/s]", side: "bottom" };
  const colorbar = { ...coloraxis.colorbar, title, thickness: 8, orientation: "h", y: -0.24, yanchor: "top" };
  const small = {
    ...layout, showlegend: false, font: { size: 11 }, margin: { l: 8, r: 8, t: 4, b: 4 },
    xaxis: { ...xaxis, title: { ...xaxis.title, standoff: 2 } },
    yaxis: { ...yaxis, title: { ...yaxis.title, standoff: 6 } },
    coloraxis: { ...coloraxis, colorbar }, template
  };
  return Plotly.toImage({ data: traces, layout: small }, { width: 260, height: 270, scale: 4 });
})()
"""
"""The map in the size of a column of the README's table, where its text can be read."""


def collect(name: str, directory: Path) -> Path:
    """Collect one of the configurations, unless that was done before."""
    if not directory.exists():
        config = ROOT / "configs" / f"{name}.yaml"
        command = [sys.executable, "-m", "throwcollect", "up", "--runtime", "local", str(config)]
        subprocess.run([*command, "--output", str(directory)], check=True)
    return directory


def far_throw(directory: Path) -> int:
    """The trial that landed farthest from the robot."""
    landed = throwcollect.load(directory).select("outcome == 'landed'")
    return max(landed, key=lambda throw: throw["landing_x_m"]).trial


def write(picture: Path, name: str) -> None:
    """Write a picture as WebP, no wider than is shown."""
    with Image.open(picture) as image:
        height = round(image.height * WIDTH / image.width)
        white = Image.new("RGBA", image.size, "white")
        white.alpha_composite(image.convert("RGBA"))
        white.convert("RGB").resize((WIDTH, height), Image.Resampling.LANCZOS).save(
            PICTURES / f"{name}.webp", quality=78
        )


def main(kept: Path) -> None:
    """Write all pictures, of datasets that are made in the directory `kept`, unless they are there."""
    sys.path.insert(0, str(ROOT))
    from tests.e2e.chromium import browse

    wide, ur5, quickstart = (collect(name, kept / name) for name in ("wide", "ur5", "quickstart"))
    for picture, dataset in (("throw", wide), ("ur5", ur5)):
        render(dataset, PICTURES / f"{picture}.webp", trials=[far_throw(dataset)], slow=1.5)
    page = Path(tempfile.mkdtemp(dir=kept), "report.html")
    command = [sys.executable, "-m", "throwcollect", "dataset", "report", str(quickstart)]
    subprocess.run([*command, "--output", str(page)], check=True)
    with browse(page.as_uri(), width=1200, height=900) as tab:
        tab.wait_for("document.querySelectorAll('.main-svg').length > 2")
        tab.picture(kept / "report.png")
        (kept / "landing-map.png").write_bytes(base64.b64decode(tab.evaluate(MAP).partition(",")[2]))
    write(kept / "landing-map.png", "landing-map")
    write(kept / "report.png", "report")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as directory:
            main(Path(directory))
