#!/bin/bash
# Installs what is missing, builds preset test and runs every test. The last line is ctest's summary.
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
cd "$root"
source samples/install.sh
install_packages "$root" tests/packages.txt
cmake --preset test
cmake --build --preset test

export PIPELINE_ALL_PROGRAMS=1  # a test that misses a program fails
log="$(mktemp)"
trap 'rm -f "$log"' EXIT
status=0
# One more than there are cores: some tests wait for the disk, or for the page in a browser.
ctest --preset test -j "$(($(nproc) + 1))" 2>&1 | tee "$log" || status=$?
# On a failure ctest prints the names after its summary: repeat the summary as the last line.
grep 'tests passed' "$log" | tail -1
exit "$status"
