// Support for tests of transforms.json: a folder with three pictures, and a scene of two of them.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "io/image/image.h"
#include "io/scene/scene.h"

class TransformsFolder : public testing::Test {
 protected:
  static constexpr int kWidth = 8, kHeight = 6;

  // Written once: every picture is synced to disk, which takes long while other tests write too.
  static void SetUpTestSuite() {
    for (const char* name : {"a.png", "b.png", "c.jpg"})
      io::WriteImage(folder_ / "images" / name, io::MakeImage(kWidth, kHeight, 3));
  }
  static void TearDownTestSuite() { std::filesystem::remove_all(folder_); }

  // Its numbers need all their digits. Pictures lie in folder/images.
  static io::Scene AwkwardScene(const std::filesystem::path& folder) {
    io::Scene scene;
    scene.cameras = {
        {.width = kWidth, .height = kHeight, .fl_x = 10.0 / 3, .fl_y = 3.3, .cx = 4.1, .cy = 2.9}};
    const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, -3).normalized();
    scene.frames = {
        {folder / "images/a.png", 0, {Eigen::AngleAxisd(0.1, axis).toRotationMatrix(), {0.1, 1e-9, 1e5}}},
        {folder / "images/b.png", 0, {Eigen::AngleAxisd(2.1, axis).toRotationMatrix(), {-0.3, 7, -1.0 / 7}}}};
    return scene;
  }

  static inline const std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("io_transforms_test_" + std::to_string(getpid()));
  static inline const std::filesystem::path json_ = folder_ / "transforms.json";
};
