"""`throwcollect serve` and `view`: let a browser or a program look inside runs and manage them."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING

from throwcollect.cli.options import JsonOption, RunOption
from throwcollect.cli.printing import show, tell
from throwcollect.config.default_path import DEFAULT_CONFIG
from throwcollect.errors import ConfigError

if TYPE_CHECKING:
    from throwcollect.serve.finding import Address

_LOOPBACK = ("127.0.0.1", "localhost", "::1")


def serve(
    catalogue: Path | None = None,
    *,
    host: str = "127.0.0.1",
    port: int | None = None,
    datasets: Path = Path("datasets"),
    models: Path = Path("models"),
    token_file: Path | None = None,
    certificate: Path | None = None,
    key: Path | None = None,
    in_the_clear: bool = False,
    origins: list[str] | None = None,
    names: list[str] | None = None,
    json: JsonOption = False,
) -> None:
    """Serve a page, REST, the state of all runs and rosbridge on one port, until it is stopped.

    Options:
        catalogue (CATALOG): YAML file with components, or a configuration; throwcollect.yaml by default.
        host (ADDRESS): Address to listen at.
        port (0..65535): Port; by default 8080, or a free one if that is taken.
        datasets (DIR): Directory in which instances write datasets.
        models (DIR): Directory of models, each in a directory of its own.
        token_file (FILE): Tokens that outlive a restart; a file that does not exist is made.
        certificate (--tls-cert FILE): Certificate in PEM: speak HTTPS.
        key (--tls-key FILE): Its key in PEM.
        in_the_clear: Serve other machines without TLS, where the network is trusted.
        origins (--allow-origin URL): Origin of pages served elsewhere that may connect.
        names (--name NAME): Host name by which clients know this machine.
    """
    from throwcollect.serve.access import Keys
    from throwcollect.serve.catalogue import Catalogue
    from throwcollect.serve.instances import Instances
    from throwcollect.serve.server_process import serve as serve_all

    if (certificate is None) != (key is None):
        raise ConfigError("--tls-cert and --tls-key: should be given together")
    if host not in _LOOPBACK and certificate is None and not in_the_clear:
        raise ConfigError(
            f"--host {host}: others on that network could read the token while it is sent",
            hint="--tls-cert and --tls-key, or --in-the-clear if the network is trusted; ssh -L needs neither",
        )

    def show_address(address: Address, code: str) -> None:
        page = address.page(code)
        show({"url": address.url, "page": page, "pid": address.pid}, f"open {page}", json=json, indent=None)
        if not json:
            tell(write_tunnel(address))

    # Without a file, the catalogue is empty, and no run can be begun.
    offered = Catalogue.read(catalogue or DEFAULT_CONFIG) if catalogue or DEFAULT_CONFIG.exists() else Catalogue({})
    serve_all(
        Instances(offered, datasets.absolute()),
        models.absolute(),
        host=host,
        port=port,
        certificate=certificate,
        key=key,
        origins=frozenset(origins or ()),
        names=frozenset(names or ()),
        keys=Keys() if token_file is None else Keys.of_file(token_file),
        on_ready=show_address,
    )


def view(run: RunOption = None, json: JsonOption = False) -> None:
    """Print the address of a page on which runs are seen, and open it where there is a screen."""
    from throwcollect.collect.runs.run_selection import find_run_to_watch
    from throwcollect.serve.finding import ensure_server, make_page_address

    watched = find_run_to_watch(run).id if run is not None else None
    address = ensure_server()
    page = make_page_address(address, watched)
    show({"url": address.url, "page": page}, page, json=json, indent=None)
    if json:
        return
    tell(write_tunnel(address))
    if sys.stdout.isatty() and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        webbrowser.open(page)


def write_tunnel(address: Address) -> str:
    """Write the line on how another machine reaches the page."""
    import socket

    port = address.url.rpartition(":")[2]
    tunnel = f"ssh -L {port}:127.0.0.1:{port} {socket.gethostname()}"
    return f"from another machine: {tunnel}   and then open the same address, which works only once"
