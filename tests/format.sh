#!/bin/bash
# Fails where clang-format would change a file.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
git ls-files '*.h' '*.cpp' '*.inc' | xargs clang-format --dry-run --Werror
