// curve.csv: how loss and quality went with time, kept across resumes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace nerf {

struct CurvePoint {
  std::uint64_t step = 0;
  double wall_s = 0, cpu_s = 0;
  double loss = 0, train_psnr = 0,
         heldout_psnr = 0;  // held-out: 8192 fixed random pixels of the held-out pictures
};

// Columns of the file, row by row; NaN where a cell is empty.
struct CurveColumns {
  std::vector<double> step, wall_s, cpu_s, loss, train_psnr, heldout_psnr;
};

// Columns are found by their names in the first line. Empty when there is no such file.
CurveColumns ReadTrainingCurve(const std::filesystem::path& path);

class TrainingCurve {
 public:
  // Continues the file when it exists.
  explicit TrainingCurve(const std::filesystem::path& path);
  void Add(const CurvePoint& point);
  void Write() const;

 private:
  std::filesystem::path path_;
  std::string text_;
};

}  // namespace nerf
