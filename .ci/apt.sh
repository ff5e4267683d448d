# Installs and downloads packages of Debian; the scripts beside this one source it in the root of the clone, which has a build/.

# Whether a file was made within the last hour: lists of packages are fetched once for all that is installed together.
is_new() { [ -n "$(find "$1" -mmin -60 2> /dev/null)" ]; }

# Installs the packages whose commands are missing: `install_missing COMMAND:PACKAGE...`. All at once, as the machine's manual pages
# are indexed after each installation. Says on standard output why it cannot.
install_missing() {
    local pair packages=()
    for pair; do command -v "${pair%%:*}" > /dev/null || packages+=("${pair#*:}"); done
    [ ${#packages[@]} -gt 0 ] || return 0
    [ "$(id -u)" = 0 ] || { echo "only root can install ${packages[*]}"; return 1; }
    command -v apt-get > /dev/null || { echo "there is no apt-get to install ${packages[*]}"; return 1; }
    install_packages "${packages[@]}" > build/apt.log 2>&1 \
        || { echo "${packages[*]} cannot be installed: $(tail -n 1 build/apt.log)"; return 1; }
}

# Installs packages of the release that this machine runs.
install_packages() {
    # Another installation may be under way.
    local apt=(apt-get -qq -o DPkg::Lock::Timeout=300)
    is_new build/apt-updated || { flock -o build/apt.lock "${apt[@]}" update && touch build/apt-updated; } || return
    "${apt[@]}" install -y --no-install-recommends "$@"
}

# Downloads packages of another release into a directory: `download_packages RELEASE DIRECTORY PACKAGE...`. The release has lists
# of its own, in build/apt, so that those of the machine stay as they are.
download_packages() (
    local own=$PWD/build/apt/$1 release=$1 directory=$2 mirror
    shift 2
    mirror=$(awk '/^URIs:/ { print $2; exit }' /etc/apt/sources.list.d/debian.sources 2> /dev/null)
    [ -n "$mirror" ] || { echo "there is no Debian mirror to take packages of $release from" >&2; return 1; }
    mkdir -p "$own/lists/partial" "$own/cache/archives/partial"
    # Two scripts may want packages of the same release at the same time, and apt would refuse the second one.
    exec 9> "$own/lock"
    flock 9
    printf 'Types: deb\nURIs: %s\nSuites: %s\nComponents: main\nSigned-By: %s\n' "$mirror" "$release" \
        /usr/share/keyrings/debian-archive-keyring.gpg > "$own/debian.sources"
    local apt=(apt-get -qq -o Dir::Etc::sourcelist="$own/debian.sources" -o Dir::Etc::sourceparts=/dev/null
        -o Dir::State::lists="$own/lists" -o Dir::Cache="$own/cache" -o APT::Sandbox::User=root -o Acquire::Languages=none)
    is_new "$own/updated" || { "${apt[@]}" update && touch "$own/updated"; } || return
    (cd "$directory" && "${apt[@]}" download "$@")
)
