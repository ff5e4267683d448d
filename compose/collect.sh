#!/bin/sh
# Collects a dataset on Docker Compose (v2 or 1.29) and takes it out of the volume, for continuous integration:
#   compose/collect.sh CONFIG SIMULATIONS OUTPUT
# The exit code is that of the collection. OUTPUT must not exist.
set -eu
if [ $# -ne 3 ]; then
    echo "usage: $0 CONFIG SIMULATIONS OUTPUT" >&2
    exit 2
fi
config=$1 simulations=$2 output=$3
if [ ! -f "$config" ]; then
    echo "$0: $config: no such file" >&2
    exit 2
fi
case $simulations in
'' | *[!0-9]* | 0)
    echo "$0: $simulations simulations; a whole number from 1 on is wanted" >&2
    exit 2
    ;;
esac
if [ -e "$output" ]; then
    echo "$0: $output exists already" >&2
    exit 2
fi
# With it, cd might go elsewhere, and would print where.
unset CDPATH

CONFIGS=$(cd -- "$(dirname -- "$config")" && pwd)
CONFIG=$(basename -- "$config")
RUN_USER=$(id -u):$(id -g)
THROWCOLLECT_IMAGE=${THROWCOLLECT_IMAGE:-throwcollect:0.2.0}
THROWCOLLECT_HOST=${THROWCOLLECT_HOST:-$(uname -n)}
# The name in the volume, from where the dataset is taken below.
DATASET=dataset
export CONFIGS CONFIG RUN_USER THROWCOLLECT_IMAGE THROWCOLLECT_HOST DATASET

project=throwcollect-$$
file=$(dirname -- "$0")/compose.yaml
if docker compose version >/dev/null 2>&1; then
    compose() { docker compose -f "$file" -p "$project" "$@"; }
elif command -v docker-compose >/dev/null; then
    compose() { docker-compose -f "$file" -p "$project" "$@"; }
else
    echo "$0: neither \`docker compose\` nor docker-compose is here" >&2
    exit 2
fi
# Docker says why it cannot: no engine answers, or there is no such image.
if ! docker image inspect "$THROWCOLLECT_IMAGE" >/dev/null 2>&1 && ! docker pull "$THROWCOLLECT_IMAGE" >&2; then
    echo "$0: $THROWCOLLECT_IMAGE: cannot be had; \`make image\` builds the default one" >&2
    exit 2
fi
# Before anything is collected that could not be put there.
mkdir -p -- "$output" || exit 2
place=$(cd -- "$output" && pwd)
case $CONFIGS$place in *:*)
    rmdir -- "$output" 2>/dev/null || true
    echo "$0: $CONFIGS, $place: should have no colon, as Docker mounts no such directory" >&2
    exit 2
    ;;
esac
# Whatever happens, nothing stays behind but a dataset that could not be taken out.
trap 'compose down --volumes --timeout 5 >/dev/null 2>&1; rmdir -- "$output" 2>/dev/null || true' EXIT
# Compose is asked to stop as well, and ends the collection in order; what it has is taken out before anything is removed.
stopped=
trap 'stopped=130' INT TERM

code=0
compose up --scale sim="$simulations" --exit-code-from coordinator || code=$?
code=${stopped:-$code}

# Also of a collection that was broken off, if it ever began. Where nothing was begun there is nothing to keep, and the next
# try wants a new directory.
if ! docker run --rm --network none --user "$RUN_USER" --entrypoint sh \
    -v "${project}_data:/data:ro" -v "$place:/out" "$THROWCOLLECT_IMAGE" \
    -c 'test ! -d /data/dataset || cp -r /data/dataset/. /out'; then
    trap - EXIT
    compose down --timeout 5 >/dev/null 2>&1 || true
    docker volume rm "${project}_key" >/dev/null 2>&1 || true
    rmdir -- "$output" 2>/dev/null || true
    echo "$0: what was collected cannot be copied to $output and stays in the volume ${project}_data; to take it out:" >&2
    echo "  docker run --rm --user $RUN_USER --entrypoint cp -v ${project}_data:/data:ro -v /DIRECTORY:/out" \
        "$THROWCOLLECT_IMAGE -r /data/dataset/. /out" >&2
    [ "$code" != 0 ] || code=1
fi
exit "$code"
