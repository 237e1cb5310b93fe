# Shared by ./climb and ./test: sourced with the project root as working directory.

say() { printf 'clamber: %s\n' "$*" >&2; }

# Installs the packages of scripts/packages.txt that are missing; asks apt nothing when none is.
install_packages() {
  local wanted missing=() package sudo=()
  mapfile -t wanted < <(sed 's/#.*//; s/[[:space:]]//g; /^$/d' scripts/packages.txt)
  for package in "${wanted[@]}"; do
    [[ $(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null) == installed ]] ||
      missing+=("$package")
  done
  # Node.js from elsewhere brings its own npm, which Debian's would conflict with.
  command -v npm >/dev/null || missing+=(nodejs npm)
  ((${#missing[@]})) || return 0
  say "installing ${#missing[@]} packages: ${missing[*]}"
  if ((EUID != 0)); then
    command -v sudo >/dev/null || { say "error: run as root once, or install sudo"; return 1; }
    sudo=(sudo)
  fi
  "${sudo[@]}" apt-get update -qq
  # A machine that is thrown away after the run need not wait for its disk at every file.
  "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -qq --no-install-recommends \
    ${CI:+-o Dpkg::Options::=--force-unsafe-io} "${missing[@]}" >&2
}

# build [target]: configures once, then builds what changed with the release preset.
build() {
  [[ -f build/release/build.ninja ]] || cmake --preset release >&2
  cmake --build --preset release ${1:+--target "$1"} >&2
}
