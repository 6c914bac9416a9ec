# Sourced by samples/run.sh and tests/run.sh: installs Debian packages that are missing.

# install_packages ROOT [LIST...]: those of samples/packages.txt, and of further lists relative to ROOT.
install_packages() {
  local root="$1" package missing=()
  shift
  while read -r package; do
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || missing+=("$package")
  done < <(cd "$root" && cat samples/packages.txt "$@")
  if [ ${#missing[@]} -eq 0 ]; then
    echo "install: every package is there"
    return
  fi
  echo "install: apt-get install ${missing[*]}"
  local sudo=()
  if [ "$(id -u)" != 0 ]; then
    command -v sudo > /dev/null || { echo "install: run me as root, or install sudo" >&2; return 1; }
    sudo=(sudo)
  fi
  "${sudo[@]}" apt-get update -q
  "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${missing[@]}"
}
