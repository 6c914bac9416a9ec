// A finished run of a sphere, made without the stages.
#pragma once

#include <filesystem>
#include <string>
#include "io/base/json.h"

#include "io/scene/scene.h"

namespace tests {

// Names like these reach the report from users' disks.
inline const std::string kNastyName = "</script><img src=x onerror=alert(1)> & \"quotes\" \xff.jpg";

class SphereRun {
 public:
  static constexpr int kViews = 6;  // held out

  SphereRun();
  ~SphereRun();
  SphereRun(const SphereRun&) = delete;
  SphereRun& operator=(const SphereRun&) = delete;

  const std::filesystem::path& path() const { return path_; }
  void Write(const std::filesystem::path& file, const io::Json& json) const;

 private:
  io::Scene Split(const std::string& name, int n) const;
  void WriteScene();
  void WriteTraining() const;
  void WriteScores() const;
  void WriteFilm() const;
  void WritePictures() const;

  const std::filesystem::path path_;
  io::Scene train_, test_;
};

// Exit code of `pipeline report --out=run_folder`.
int RunReport(const std::filesystem::path& run_folder);

}  // namespace tests
