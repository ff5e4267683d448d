#!/usr/bin/env bash
# Puts Compose v2 where the tests look for it, build/docker-config, unless the machine has it: Debian bookworm has 1.29
# alone, and the plugin of Debian sid runs there as it is.
set -euo pipefail
cd "$(dirname "$0")/.."
plugins=build/docker-config/cli-plugins
if docker compose version > /dev/null 2>&1 || [ -x $plugins/docker-compose ]; then
    exit 0
fi
mirror=$(awk '/^URIs:/ { print $2; exit }' /etc/apt/sources.list.d/debian.sources)
apt=$(mktemp -d)
trap 'rm -rf "$apt"' EXIT
mkdir -p "$apt/lists/partial" "$apt/cache/archives/partial" $plugins
printf 'Types: deb\nURIs: %s\nSuites: sid\nComponents: main\nSigned-By: %s\n' \
    "$mirror" /usr/share/keyrings/debian-archive-keyring.gpg > "$apt/sid.sources"
of_sid() {
    apt-get -qq -o Dir::Etc::sourcelist="$apt/sid.sources" -o Dir::Etc::sourceparts=/dev/null \
        -o Dir::State::lists="$apt/lists" -o Dir::Cache="$apt/cache" -o APT::Sandbox::User=root "$@"
}
of_sid update
(cd "$apt" && of_sid download docker-compose)
dpkg-deb --fsys-tarfile "$apt"/docker-compose_*.deb |
    tar -xO ./usr/libexec/docker/cli-plugins/docker-compose > "$apt/docker-compose"
install -m 755 "$apt/docker-compose" $plugins/
DOCKER_CONFIG=build/docker-config docker compose version
