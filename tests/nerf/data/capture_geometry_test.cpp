// What a capture's cameras say, and captures that say too little.
#include "nerf/data/capture_geometry.h"

#include "io/base/error.h"
#include "tests/support/files/picture_scene.h"
#include "tests/support/files/temp_dir.h"

namespace nerf {
namespace {

TEST(CaptureGeometry, WithoutCamerasOrWithAllInOnePlaceThereIsNone) {
  EXPECT_ERROR(MeasureCapture(tests::SceneOf({}, 16, 16)), io::ExitCode::kBadInput, "without cameras");
  EXPECT_ERROR(MeasureCapture(tests::SceneOf({"a.png", "b.png"}, 16, 16)),
               io::ExitCode::kBadInput,
               "all cameras stand in one place");
}

}  // namespace
}  // namespace nerf
