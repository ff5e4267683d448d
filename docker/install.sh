#!/bin/sh
# Installs into /opt/venv what the arguments of `uv pip install` say: from the wheels beside this script, if there are any.
set -eu
here=$(dirname "$0")
[ -z "$(find "$here" -maxdepth 1 -name '*.whl')" ] || export UV_OFFLINE=1 UV_FIND_LINKS="$here"
exec uv pip install --quiet --python /opt/venv/bin/python --no-cache --link-mode copy "$@"
