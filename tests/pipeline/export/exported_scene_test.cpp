// The views of an exported scene and their names.
#include "pipeline/export/exported_scene.h"

#include <gtest/gtest.h>

namespace pipeline {
namespace {

TEST(ExportedScene, ViewsHaveNamesOfTheirOwnWithoutBlanks) {
  ExportedScene scene;
  scene.folder = "/run/scene";
  scene.train.cameras.resize(1), scene.test.cameras.resize(1);
  for (const char* path :
       {"/run/scene/images/a b.png", "/run/scene/images/a_b.png", "/run/scene/train/r 0.png"})
    scene.train.frames.push_back({path, 0, {}, {}});
  scene.test.frames.push_back({"/run/scene/test/r 0.png", 0, {}, {}});
  const std::vector<ExportedView> views = ViewsOf(scene);
  std::vector<std::string> names;
  for (const ExportedView& view : views) names.push_back(view.name);
  EXPECT_EQ(names, (std::vector<std::string>{"a_b.png", "a_b_.png", "train/r_0.png", "test/r_0.png"}));
  EXPECT_FALSE(views[2].is_test);
  EXPECT_TRUE(views[3].is_test);
  EXPECT_EQ(views[3].frame, &scene.test.frames[0]);
}

}  // namespace
}  // namespace pipeline
