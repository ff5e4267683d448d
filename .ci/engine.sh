#!/usr/bin/env bash
# Makes a fresh Debian machine ready for the tests that need a Docker engine: engine, base image, Compose, wheelhouse, image.
# What is there already is left as it is, so running it again takes seconds. `PYTHON` names one that has throwcollect
# installed from this clone, and pip; `AFTER` the process that installs it, which the last two steps wait for.
#
# Where no engine can be had, it says why on standard output and in build/engine-unavailable, and succeeds: the tests
# that need one are then skipped, with that reason.
set -euo pipefail
cd "$(dirname "$0")/.."
. .ci/apt.sh
python=${PYTHON:-.venv/bin/python}
base=throwcollect-base:bookworm
state=${THROWCOLLECT_ENGINE_DIR:-/var/lib/throwcollect-engine}
reason=build/engine-unavailable
export DEBIAN_FRONTEND=noninteractive
# Where dockerd and what it calls live; not in everybody's path.
export PATH="$PATH:/usr/sbin:/sbin"
mkdir -p build
rm -f "$reason"

unavailable() {
    echo "$*" > "$reason"
    echo "engine unavailable: $*"
    exit 0
}

answers() { docker version --format '{{.Server.Version}}' > /dev/null 2>&1; }

start_engine() {
    [ -z "${DOCKER_HOST:-}" ] || unavailable "no Docker engine answers at $DOCKER_HOST"
    [ "$(id -u)" = 0 ] || unavailable "no Docker engine answers, and only root can start one"
    # Engines share the machine's bridge and packet filter: a second one takes them from the first.
    [ -z "$(pidof dockerd)" ] || unavailable "dockerd runs, but does not answer"
    # Together with what is needed further down, if all of it can be had.
    local tools=(dockerd:docker.io docker:docker.io) why
    install_missing "${tools[@]}" mmdebstrap:mmdebstrap docker-compose:docker-compose > /dev/null \
        || why=$(install_missing "${tools[@]}") || unavailable "$why"
    # Where services are started when they are installed, it runs by now.
    answers && return
    mkdir -p "$state"
    setsid dockerd --data-root "$state/data" --exec-root "$state/exec" --pidfile "$state/dockerd.pid" \
        > "$state/dockerd.log" 2>&1 < /dev/null &
    local process=$!
    for _ in $(seq 300); do
        if answers; then
            echo "engine started; end it with: kill \$(cat $state/dockerd.pid)"
            return
        fi
        kill -0 $process 2> /dev/null || break
        sleep 0.1
    done
    # A second one would fail in the same way.
    kill $process 2> /dev/null || true
    unavailable "dockerd does not answer: $(grep -E 'level=(error|fatal)|failed' "$state/dockerd.log" | tail -n 1)"
}

if command -v docker > /dev/null && answers; then
    echo "engine: $(docker version --format '{{.Server.Version}}')"
else
    start_engine
fi
if ! docker image inspect "$base" "$base-build" > /dev/null 2>&1; then
    why=$(install_missing mmdebstrap:mmdebstrap) || unavailable "$why"
    docker/base.sh "$base" > build/base.log 2>&1 || { tail -n 5 build/base.log; unavailable "no base image could be made"; }
    echo "base image: $base"
fi
# Without one of the two, its own tests alone are skipped.
why=$(install_missing docker-compose:docker-compose) || echo "no Compose 1.29 for the tests: $why"
.ci/compose.sh || echo "no Compose v2 for the tests"
[ -z "${AFTER:-}" ] || tail --pid="$AFTER" -f /dev/null
"$python" docker/wheelhouse.py --ros docker/wheelhouse
# tests/docker/test_image.py tests what is built, beside others.
make image BUILD="--build-arg BASE_IMAGE=$base --build-arg BUILD_IMAGE=$base-build --build-arg SELFTEST=true" > build/image.log 2>&1 \
    || { tail -n 25 build/image.log; exit 1; }
