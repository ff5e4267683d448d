#!/usr/bin/env bash
# Puts Compose v2 where the tests look for it, build/docker-config, unless the machine has it: Debian bookworm has 1.29
# alone, and the plugin of Debian sid runs there as it is.
set -euo pipefail
cd "$(dirname "$0")/.."
. .ci/apt.sh
plugins=build/docker-config/cli-plugins
if docker compose version > /dev/null 2>&1 || [ -x $plugins/docker-compose ]; then
    exit 0
fi
packages=$(mktemp -d)
trap 'rm -rf "$packages"' EXIT
mkdir -p $plugins
download_packages sid "$packages" docker-compose
dpkg-deb --fsys-tarfile "$packages"/docker-compose_*.deb |
    tar -xO ./usr/libexec/docker/cli-plugins/docker-compose > "$packages/docker-compose"
install -m 755 "$packages/docker-compose" $plugins/
DOCKER_CONFIG=build/docker-config docker compose version
