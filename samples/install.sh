# Sourced by samples/run.sh and tests/run.sh: installs the Debian packages of samples/packages.txt that are missing.

install_packages() {
  local root="$1" package missing=()
  while read -r package; do
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || missing+=("$package")
  done < "$root/samples/packages.txt"
  if [ ${#missing[@]} -eq 0 ]; then
    echo "install: every package of samples/packages.txt is there"
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
