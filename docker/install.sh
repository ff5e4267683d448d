#!/bin/sh
# Installs into /opt/venv what the arguments of `pip install` say: from the wheels beside this script, if there are any.
set -eu
cd "$(dirname "$0")"
if [ -n "$(find . -maxdepth 1 -name '*.whl')" ]; then
    # The base image may have no pip; a wheel of it runs as it is.
    export PIP_NO_INDEX=1 PIP_FIND_LINKS="$PWD" PYTHONPATH="$(echo "$PWD"/pip-*.whl)"
fi
exec python3 -m pip --python /opt/venv/bin/python --disable-pip-version-check \
    install --no-cache-dir --no-compile --root-user-action=ignore "$@"
