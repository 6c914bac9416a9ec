#!/bin/bash
# Installs, builds presets fuzz and test, runs the fuzz targets for a minute each, the tests of what works on raw memory
# under AddressSanitizer and UBSan, and then every test. The last line is ctest's summary of the tests.
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
cd "$root"
source samples/install.sh
install_packages "$root" tests/packages.txt

status=0
echo "fuzz: preset fuzz"
cmake --preset fuzz
cmake --build --preset fuzz
ctest --preset fuzz -j2 || status=$?

echo "build: preset test"
cmake --preset test
cmake --build --preset test

export PIPELINE_ALL_PROGRAMS=1  # a test that misses a program fails
log="$(mktemp)"
trap 'rm -f "$log"' EXIT
ctest --preset test -j2 2>&1 | tee "$log" || status=$?
# On a failure ctest prints the names after its summary: repeat the summary as the last line.
grep 'tests passed' "$log" | tail -1
exit "$status"
