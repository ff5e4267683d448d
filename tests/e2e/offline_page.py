"""Opens the page of a server where there is no network but the machine itself; run below ``unshare --net``.

Arguments: a catalogue with the component `throws`, and a directory. Prints what came of it as JSON.
"""

from __future__ import annotations

import fcntl
import json
import socket
import struct
import sys
from pathlib import Path

from tests.e2e.chromium import browse
from tests.e2e.page import load, press, serve

_SIOCSIFFLAGS, _UP = 0x8914, 1
_WHOLE = """
(() => {
  const { view, meshes } = throwcollect;
  const station = view.stations.get(view.shown[0]);
  return station?.robot?.isWhole && station.trails.count > 0 && meshes.count;
})()
"""


def main(catalogue: Path, directory: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, _SIOCSIFFLAGS, struct.pack("16sh14x", b"lo", _UP))
    networks = sorted(name for _, name in socket.if_nameindex())
    with (
        serve(catalogue, directory / "datasets") as told,
        browse(told["page"], width=800, height=600, features={"prefers-reduced-motion": "reduce"}) as tab,
    ):
        load(tab)
        press(tab, "Start Throws")
        meshes = tab.wait_for(_WHOLE, within_s=150, every_s=1)
        print(json.dumps({"networks": networks, "meshes": meshes, "errors": tab.errors}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
