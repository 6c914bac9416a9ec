#!/bin/bash
# From a bare Debian 12 to a film: installs, builds, photographs the sample scene, and runs the pipeline on it.
# Every step that is done already is skipped, so an interrupted run continues.
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
cd "$root"
source samples/install.sh
install_packages "$root"

echo "build: preset release"
cmake --preset release
cmake --build --preset release

capture=build/sample
if [ -d "$capture/photos" ]; then
  echo "sample: $capture/photos is there"
else
  build/release/bin/make_capture --out "$capture"
fi
build/release/bin/pipeline run "$capture/photos" --out "$capture/run" --time 4m

for product in "$capture/run/render/novel_view.mp4" "$capture/run/report.html"; do
  [ -s "$product" ] || { echo "samples/run.sh: $product is missing" >&2; exit 70; }
done
echo "film:   $root/$capture/run/render/novel_view.mp4"
echo "report: $root/$capture/run/report.html"
