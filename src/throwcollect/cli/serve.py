"""`throwcollect serve` and `view`: let a browser or a program look inside runs and manage them."""

from __future__ import annotations

import json as jsonlib
import os
import sys
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from throwcollect.cli.options import JsonOption, RunOption
from throwcollect.cli.printing import tell
from throwcollect.config.default_path import DEFAULT_CONFIG
from throwcollect.errors import ConfigError

if TYPE_CHECKING:
    from throwcollect.serve.finding import Address

_LOOPBACK = ("127.0.0.1", "localhost", "::1")


def serve(
    catalogue: Annotated[
        Path | None,
        typer.Argument(
            metavar="CATALOG",
            help="YAML file with components, or a configuration; throwcollect.yaml by default.",
            readable=False,
        ),
    ] = None,
    host: Annotated[str, typer.Option("--host", metavar="ADDRESS", help="Address to listen at.")] = "127.0.0.1",
    port: Annotated[
        int | None,
        typer.Option("--port", min=0, max=65535, help="Port; by default 8080, or a free one if that is taken."),
    ] = None,
    datasets: Annotated[
        Path,
        typer.Option("--datasets", metavar="DIR", file_okay=False, help="Directory in which instances write datasets."),
    ] = Path("datasets"),
    models: Annotated[
        Path,
        typer.Option(
            "--models", metavar="DIR", file_okay=False, help="Directory of models, each in a directory of its own."
        ),
    ] = Path("models"),
    token_file: Annotated[
        Path | None,
        typer.Option(
            "--token-file", metavar="FILE", help="Tokens that outlive a restart; a file that does not exist is made."
        ),
    ] = None,
    certificate: Annotated[
        Path | None, typer.Option("--tls-cert", metavar="FILE", exists=True, help="Certificate in PEM: speak HTTPS.")
    ] = None,
    key: Annotated[Path | None, typer.Option("--tls-key", metavar="FILE", exists=True, help="Its key in PEM.")] = None,
    in_the_clear: Annotated[
        bool, typer.Option("--in-the-clear", help="Serve other machines without TLS, where the network is trusted.")
    ] = False,
    origins: Annotated[
        list[str] | None,
        typer.Option("--allow-origin", metavar="URL", help="Origin of pages served elsewhere that may connect."),
    ] = None,
    names: Annotated[
        list[str] | None, typer.Option("--name", metavar="NAME", help="Host name by which clients know this machine.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Serve a page, REST, the state of all runs and rosbridge on one port, until it is stopped."""
    from throwcollect.serve.access import Keys
    from throwcollect.serve.catalogue import Catalogue
    from throwcollect.serve.instances import Instances
    from throwcollect.serve.server_process import Tls
    from throwcollect.serve.server_process import serve as serve_all

    if (certificate is None) != (key is None):
        raise ConfigError("--tls-cert and --tls-key: should be given together")
    if host not in _LOOPBACK and certificate is None and not in_the_clear:
        raise ConfigError(
            f"--host {host}: anybody on that network could read the token while it is sent",
            hint="--tls-cert and --tls-key, or --in-the-clear if the network is trusted; ssh -L needs neither",
        )
    tls = None if certificate is None or key is None else Tls(certificate, key)

    def show_address(address: Address, code: str) -> None:
        if json:
            typer.echo(jsonlib.dumps({"url": address.url, "page": address.page(code), "pid": address.pid}))
        else:
            typer.echo(f"open {address.page(code)}")
            tell(write_tunnel(address))

    serve_all(
        Instances(Catalogue.read(catalogue) if catalogue else Catalogue.find(DEFAULT_CONFIG), datasets.absolute()),
        models.absolute(),
        host=host,
        port=port,
        tls=tls,
        origins=frozenset(origins or ()),
        names=frozenset(names or ()),
        keys=None if token_file is None else Keys.of_file(token_file),
        tell=show_address,
    )


def view(run: RunOption = None, json: JsonOption = False) -> None:
    """Print the address of a page on which runs are seen, and open it where there is a screen."""
    from throwcollect.runs.run_selection import find_run_to_watch
    from throwcollect.serve.finding import ensure_server, make_page_address

    shown = find_run_to_watch(run).id if run is not None else None
    address = ensure_server()
    page = make_page_address(address, shown)
    if json:
        typer.echo(jsonlib.dumps({"url": address.url, "page": page}))
        return
    typer.echo(page)
    tell(write_tunnel(address))
    if sys.stdout.isatty() and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        webbrowser.open(page)


def write_tunnel(address: Address) -> str:
    """Write the line that says how another machine reaches the page."""
    import socket

    port = address.url.rpartition(":")[2]
    tunnel = f"ssh -L {port}:127.0.0.1:{port} {socket.gethostname()}"
    return f"from another machine: {tunnel}   and then open the same address, which works only once"
