#include "nerf/training/training_curve.h"

#include <fmt/format.h>

#include "io/base/atomic_file.h"

namespace nerf {

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
