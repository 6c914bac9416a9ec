// scene.json as later stages read it; normalize_test.cpp says what is written.
#include "pipeline/stages/scene_record.h"

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "tests/support/files/temp_dir.h"

namespace {

TEST(SceneRecord, AbsentMembersKeepTheirDefaultsAndWrongTypesAreNamed) {
  const TempDir run;
  EXPECT_EQ(pipeline::ReadSceneRecord(run.path()).protocol, "capture");
  const auto path = run / "scene/scene.json";
  WriteText(path, R"({"masks": 17})");
  const pipeline::SceneRecord record = pipeline::ReadSceneRecord(run.path());
  EXPECT_EQ(record.protocol, "capture");
  EXPECT_EQ(record.masks, 17);
  for (const char* member : {R"("protocol": 1)", R"("masks": -1)", R"("used_share": "half")"}) {
    WriteText(path, std::string("{") + member + "}");
    EXPECT_ERROR(pipeline::ReadSceneRecord(run.path()), io::ExitCode::kBadInput, "scene/scene.json");
  }
  WriteText(path, "{");
  EXPECT_ERROR(pipeline::ReadSceneRecord(run.path()), io::ExitCode::kBadInput, "scene/scene.json");
}

}  // namespace
