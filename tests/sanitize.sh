#!/bin/bash
# Builds preset fuzz and runs it: the fuzz targets for half a minute each, and the tests of most rooms under
# AddressSanitizer and UBSan. Then preset tsan-short: the tests of threads under ThreadSanitizer. Both with clang, which
# compiles them in less time than GCC.
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
cd "$root"
source samples/install.sh
install_packages "$root" tests/packages.txt
cmake --preset fuzz
cmake --build --preset fuzz
ctest --preset fuzz -j "$(($(nproc) + 1))"
cmake --preset tsan-short
cmake --build --preset tsan-short
ctest --preset tsan-short -j "$(($(nproc) + 1))"
