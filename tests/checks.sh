#!/bin/bash
# What CI runs beside the tests: the format of every file, all tests but the end-to-end one under AddressSanitizer and UBSan,
# and those that run several threads under ThreadSanitizer. Prints ctest's summaries; fails with the first fault.
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
cd "$root"
source samples/install.sh
install_packages "$root" tests/packages.txt

echo "format: clang-format on every file"
git ls-files '*.h' '*.cpp' '*.inc' | xargs clang-format --dry-run --Werror

export PIPELINE_ALL_PROGRAMS=1
for preset in asan-ubsan tsan; do
  echo "build: preset $preset"
  cmake --preset "$preset" > /dev/null
  cmake --build --preset "$preset"
  ctest --preset "$preset" -j2
done
