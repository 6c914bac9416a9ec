// Support for the tests of the ingest stage: a folder of photos or a video of one scene, and the stage run on
// it.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <set>
#include <string>
#include <vector>

#include "io/base/json.h"
#include "pipeline/ingest/ingest.h"

constexpr int kWidth = 160, kHeight = 120;

class Ingest : public testing::Test {
 protected:
  void SetUp() override {
    base_ = std::filesystem::temp_directory_path() / ("ingest_test_" + std::to_string(getpid()));
    std::filesystem::create_directories(photos());
    // Coarse structure to follow and fine detail to blur, as real surfaces have.
    cv::setRNGSeed(3);
    cv::Mat coarse(30, 225, CV_8UC3), fine(120, 900, CV_8UC3), detail;
    cv::randu(coarse, 0, 255);
    cv::randu(fine, 0, 255);
    cv::resize(coarse, texture_, {1800, 240}, 0, 0, cv::INTER_CUBIC);
    cv::resize(fine, detail, {1800, 240}, 0, 0, cv::INTER_CUBIC);
    cv::addWeighted(texture_, 0.6, detail, 0.4, 0, texture_);
  }
  void TearDown() override { std::filesystem::remove_all(base_); }

  std::filesystem::path photos() const { return base_ / "photos"; }
  std::filesystem::path run() const { return base_ / "run"; }

  // View i of a scene that moves by 40 pixels per view.
  cv::Mat View(int i) const { return texture_(cv::Rect(40 * i, 20, kWidth, kHeight)).clone(); }

  static void WriteBytes(const std::filesystem::path& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
  }
  static std::string Bytes(const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void WritePhoto(const std::string& name, const cv::Mat& mat) const {
    std::vector<uchar> bytes;
    ASSERT_TRUE(cv::imencode(".jpg", mat, bytes));
    WriteBytes(photos() / name, {bytes.begin(), bytes.end()});
  }
  void WritePhotos(int n) const {
    for (int i = 0; i < n; ++i) WritePhoto("img" + std::to_string(i) + ".jpg", View(i));
  }
  std::filesystem::path WriteVideo(int n_frames, const std::function<cv::Mat(int)>& frame) const {
    const std::filesystem::path path = base_ / "clip.avi";
    cv::VideoWriter writer(
        path.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, {kWidth, kHeight});
    for (int i = 0; i < n_frames; ++i) writer.write(frame(i));
    return path;
  }

  int Run(const std::filesystem::path& input, std::vector<std::string> flags = {}) {
    std::vector<std::string> arguments = {"ingest", input.string(), "--out", run().string()};
    arguments.insert(arguments.end(), flags.begin(), flags.end());
    std::vector<const char*> argv;
    for (const std::string& argument : arguments) argv.push_back(argument.c_str());
    testing::internal::CaptureStderr();
    const int code = pipeline::RunIngest(static_cast<int>(argv.size()), argv.data());
    message_ = testing::internal::GetCapturedStderr();
    const std::filesystem::path frames = run() / "ingest" / "frames.json";
    frames_ = std::filesystem::exists(frames) ? io::ParseJson(Bytes(frames)) : io::Json();
    return code;
  }
  // True when what was printed holds all `parts`.
  template <typename... Parts>
  bool Says(const Parts&... parts) const {
    return ((message_.find(parts) != std::string::npos) && ...);
  }
  std::string ReasonFor(const std::string& source) const {
    for (const io::Json& entry : frames_["dropped"]) {
      if (entry["source"] == source) return entry["reason"];
    }
    return "";
  }
  std::set<std::string> KeptNames() const {
    std::set<std::string> names;
    for (const io::Json& entry : frames_["kept"]) names.insert(entry["name"]);
    return names;
  }

  std::filesystem::path base_;
  cv::Mat texture_;
  std::string message_;
  io::Json frames_;
};
