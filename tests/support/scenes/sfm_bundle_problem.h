// The cost of bundle adjustment put together by hand: no gauge, no elimination of points.
#pragma once

#include <ceres/ceres.h>

#include "io/scene/colmap_model.h"
#include "sfm/bundle/bundle_adjustment.h"
#include "sfm/bundle/bundle_state.h"

// Ends only where rounding does.
inline sfm::AdjustmentOptions Tight(const std::vector<sfm::FreeIntrinsics>& free) {
  return {.free = free, .max_iterations = 200, .function_tolerance = 1e-15};
}

// state: of the model's scene.
inline void AddResiduals(const io::ColmapModel& model,
                         const std::vector<sfm::FreeIntrinsics>& free,
                         sfm::BundleState* state,
                         ceres::Problem* problem) {
  const std::vector<std::size_t> owners = sfm::LensOwners(free);
  for (const io::Observation& o : model.observations) {
    const auto frame = static_cast<std::size_t>(o.frame_index);
    const auto camera = static_cast<std::size_t>(model.scene.frames[frame].camera_index);
    problem->AddResidualBlock(new sfm::ReprojectionCost(o.xy, o.sigma, state->reference_rotations[frame]),
                              new ceres::CauchyLoss(1.0),
                              state->poses[frame].data(),
                              state->points[static_cast<std::size_t>(o.point_index)].data(),
                              state->intrinsics[camera].data(),
                              state->intrinsics[owners[camera]].data() + 1);
  }
}

// Holds what `free` does not name.
inline void HoldIntrinsics(const std::vector<sfm::FreeIntrinsics>& free,
                           sfm::BundleState* state,
                           ceres::Problem* problem) {
  for (std::size_t i = 0; i < free.size(); ++i) {
    double *focal = state->intrinsics[i].data(), *lens = focal + 1;
    if (!free[i].focal) problem->SetParameterBlockConstant(focal);
    if (!problem->HasParameterBlock(lens)) continue;
    const bool is_free[] = {free[i].aspect,
                            free[i].principal_point,
                            free[i].principal_point,
                            free[i].k1,
                            free[i].k2,
                            free[i].tangential,
                            free[i].tangential};
    std::vector<int> held;
    for (int k = 0; k < sfm::kLensIntrinsics; ++k) {
      if (!is_free[k]) held.push_back(k);
    }
    problem->SetManifold(lens, new ceres::SubsetManifold(sfm::kLensIntrinsics, held));
  }
}
