// Support for tests: small rendered pictures of a textured box, and their reconstruction.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "io/image/image.h"
#include "sfm/reconstruction.h"
#include "tests/support/scenes/look_at.h"

constexpr int kWidth = 400, kHeight = 300;
const io::Camera kCamera{.width = kWidth, .height = kHeight, .fl_x = 380, .fl_y = 380, .cx = 200, .cy = 150};

// A value in [0, 1] for each cell of a grid, without tables.
inline double CellValue(int x, int y, int layer) {
  std::uint32_t h = static_cast<std::uint32_t>(x) * 374761393u + static_cast<std::uint32_t>(y) * 668265263u +
                    static_cast<std::uint32_t>(layer) * 2246822519u;
  h = (h ^ (h >> 13)) * 1274126177u;
  return static_cast<double>((h ^ (h >> 16)) & 0xffff) / 65535;
}

// Patches of several sizes, smoothed linearly.
inline double Texture(double u, double v, int wall) {
  double sum = 0;
  for (int octave = 0; octave < 4; ++octave) {
    const double scale = 4 << octave, x = u * scale, y = v * scale;
    const int ix = static_cast<int>(std::floor(x)), iy = static_cast<int>(std::floor(y));
    const double fx = x - ix, fy = y - iy;
    const int layer = wall * 16 + octave;
    const double top = std::lerp(CellValue(ix, iy, layer), CellValue(ix + 1, iy, layer), fx);
    const double bottom = std::lerp(CellValue(ix, iy + 1, layer), CellValue(ix + 1, iy + 1, layer), fx);
    sum += std::lerp(top, bottom, fy);
  }
  return sum / 4;
}

// Inside of the box [-2, 2]^3 with a second, smaller box in the middle of the view.
inline double Shade(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
  double nearest = 1e9, value = 0;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double plane : {-2.0, 2.0, -0.5, 0.5}) {
      const double t = (plane - origin[axis]) / direction[axis];
      if (!(t > 1e-6) || t >= nearest) continue;
      const Eigen::Vector3d x = origin + t * direction;
      const double u = x[(axis + 1) % 3], v = x[(axis + 2) % 3];
      const bool inner = std::abs(plane) < 1;
      if (inner && (std::abs(u) > 0.5 || std::abs(v) > 0.5)) continue;
      nearest = t;
      value = Texture(u + 10, v + 10, axis * 4 + static_cast<int>(plane * 2 + 4));
    }
  }
  return value;
}

class SmallCapture : public testing::Test {
 protected:
  SmallCapture() {
    std::string name = (std::filesystem::temp_directory_path() / "reconstruction_XXXXXX").string();
    folder_ = mkdtemp(name.data());
  }
  ~SmallCapture() override { std::filesystem::remove_all(folder_); }

  void Add(const io::Rigid3d& world_from_cam) {
    io::Image image = io::MakeImage(kWidth, kHeight, 3);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const Eigen::Vector3d ray = world_from_cam.rotation * *io::RayFromImg(kCamera, {x + 0.5, y + 0.5});
        const auto grey =
            static_cast<std::uint8_t>(std::lround(255 * Shade(world_from_cam.translation, ray)));
        for (int c = 0; c < 3; ++c) image.Pixel(x, y)[c] = grey;
      }
    }
    const std::string name = 'p' + std::to_string(pictures_.size()) + ".png";
    std::filesystem::create_directories(folder_ / "images");
    io::WriteImage(folder_ / "images" / name, image);
    pictures_.push_back({.name = name, .width = kWidth, .height = kHeight, .focal_px = 380});
    truth_.push_back(world_from_cam);
  }

  // n pictures along an arc.
  void AddWalk(int n) {
    for (int i = 0; i < n; ++i)
      Add(LookAt({1.6 * std::sin(0.16 * i), 0.1 * i, 1.6 * std::cos(0.16 * i)}, {0, 0, 0}, {0, 1, 0}));
  }

  // A picture that has nothing in common with the others.
  void AddStranger(const std::string& name) {
    std::filesystem::create_directories(folder_ / "images");
    io::Image noise = io::MakeImage(kWidth, kHeight, 3);
    for (std::size_t i = 0; i < noise.data.size(); ++i) {
      const double value = CellValue(static_cast<int>(i / 3), name[0], 99);
      noise.data[i] = static_cast<std::uint8_t>(255 * value);
    }
    io::WriteImage(folder_ / "images" / name, noise);
    pictures_.push_back({.name = name, .width = kWidth, .height = kHeight, .focal_px = 380});
  }

  // n small grey pictures.
  void AddBlank(int n, bool is_video_frame = false) {
    std::filesystem::create_directories(folder_ / "images");
    io::Image image = io::MakeImage(64, 48, 3);
    std::fill(image.data.begin(), image.data.end(), std::uint8_t{128});
    for (int i = 0; i < n; ++i) {
      const std::string name = "blank" + std::to_string(i) + ".png";
      io::WriteImage(folder_ / "images" / name, image);
      pictures_.push_back({.name = name, .width = 64, .height = 48, .is_video_frame = is_video_frame});
    }
  }

  // How many decisions contain the text.
  long Decided(const std::string& part) const {
    return std::count_if(decisions_.begin(), decisions_.end(), [&](const std::string& line) {
      return line.find(part) != std::string::npos;
    });
  }

  sfm::Reconstruction Run(sfm::ReconstructionOptions options = {.features = 600, .threads = 2}) {
    return sfm::Reconstruct(
        pictures_, folder_ / "images", folder_ / "work", options, [this](const std::string& line) {
          decisions_.push_back(line);
        });
  }

  // What the run is refused with.
  static sfm::Refusal RefusalOf(const std::function<void()>& run) {
    try {
      run();
    } catch (const sfm::NotReconstructible& error) {
      return error.refusal();
    }
    throw std::runtime_error("accepted, expected a refusal");
  }

  std::filesystem::path folder_;
  std::vector<sfm::Picture> pictures_;
  std::vector<io::Rigid3d> truth_;
  std::vector<std::string> decisions_;
};
