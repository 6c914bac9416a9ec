#!/bin/bash
# clang-tidy on every source of the product (preset tidy: the sources of a room are joined and checked as one, where the
# analyzer follows no paths: that takes eight times as long).
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
cd "$root"
source samples/install.sh
install_packages "$root" tests/packages.txt
cmake --preset tidy > /dev/null
run-clang-tidy-14 -quiet -p build/tidy -j "$(nproc)" '^(?!.*/precompiled\.dir/)' 2> /dev/null
