#include "nerf/training/training_curve.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <sstream>

#include "io/base/atomic_file.h"

namespace nerf {
namespace {

std::vector<std::string> Cells(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
  return cells;
}

}  // namespace

CurveColumns ReadTrainingCurve(const std::filesystem::path& path) {
  CurveColumns curve;
  if (!std::filesystem::is_regular_file(path)) return curve;
  const std::pair<const char*, std::vector<double>*> columns[] = {{"step", &curve.step},
                                                                  {"wall_s", &curve.wall_s},
                                                                  {"cpu_s", &curve.cpu_s},
                                                                  {"loss", &curve.loss},
                                                                  {"train_psnr", &curve.train_psnr},
                                                                  {"heldout_psnr", &curve.heldout_psnr}};
  std::istringstream in(io::ReadFile(path));
  std::string line;
  std::getline(in, line);
  const std::vector<std::string> header = Cells(line);
  while (std::getline(in, line)) {
    const std::vector<std::string> row = Cells(line);
    for (const auto& [name, column] : columns) {
      const auto i = static_cast<std::size_t>(std::find(header.begin(), header.end(), name) - header.begin());
      double value = std::numeric_limits<double>::quiet_NaN();
      if (i < row.size()) std::from_chars(row[i].data(), row[i].data() + row[i].size(), value);
      column->push_back(value);
    }
  }
  return curve;
}

TrainingCurve::TrainingCurve(const std::filesystem::path& path)
    : path_(path), text_("step,wall_s,cpu_s,loss,train_psnr,heldout_psnr\n") {
  if (std::filesystem::exists(path)) text_ = io::ReadFile(path);
}

void TrainingCurve::Add(const CurvePoint& point) {
  text_ += fmt::format("{},{:.3f},{:.3f},{:.6g},{:.3f},{:.3f}\n",
                       point.step,
                       point.wall_s,
                       point.cpu_s,
                       point.loss,
                       point.train_psnr,
                       point.heldout_psnr);
}

void TrainingCurve::Write() const { io::WriteFileAtomically(path_, text_); }

}  // namespace nerf
