// What differs between fields in training: one optimiser step. The loop around it is in nerf/training/.
#pragma once

#include <memory>
#include <string>

#include "io/process/parallel.h"
#include "nerf/data/dataset.h"
#include "nerf/fields/checkpoint.h"
#include "nerf/fields/scene_field.h"
#include "nerf/steps/pixel_gradients.h"

namespace nerf {

struct TrainOptions;
class CameraRefinement;
class NearCameras;

// What training has in captures alone. `nerf` uses neither.
struct CaptureTerms {
  CameraRefinement* refinement = nullptr;     // null: cameras stay
  const NearCameras* near_cameras = nullptr;  // null: light near cameras costs nothing
};

struct StepOutcome {
  std::uint64_t n_rays = 0, n_samples = 0;
  double loss = 0, squared_error = 0, opacity = 0;  // means over rays; squared_error over channels as well
  double flop = 0;                                  // of the network, where it dominates; else 0
  // Not empty: a value was not finite; names it and its ray. Field and optimiser are then as before.
  std::string fault;
};

class FieldTraining {
 public:
  virtual ~FieldTraining() = default;
  // Step number state->step with state->n_rays rays; chooses the number of rays of the next one. progress:
  // share of the run, in [0, 1).
  virtual StepOutcome Step(double progress, TrainState* state) = 0;
  // What computes: "avx512 kernels", "LibTorch 1.13.0 (CPU), bf16".
  virtual std::string Arithmetic() const = 0;
  // How fast the machine computes matrix products of the network's size, measured now; 0: not measured for
  // this kind of field.
  virtual double GemmGflops() const { return 0; }
};

// All arguments must outlive the result. Results depend on seed and step, not on the number of workers.
std::unique_ptr<FieldTraining> MakeHashTraining(const Dataset& dataset,
                                                const TrainOptions& options,
                                                SceneField* scene_field,
                                                io::Workers* workers,
                                                const CaptureTerms& terms = {});
std::unique_ptr<FieldTraining> MakeMlpTraining(const Dataset& dataset,
                                               const TrainOptions& options,
                                               SceneField* scene_field,
                                               io::Workers* workers,
                                               const CaptureTerms& terms = {});

// The next batch aims at `wanted` samples; at most a factor 2 per step, since one batch may be unusual.
int NextRayCount(int n_rays, std::uint64_t n_samples, int wanted, int low, int high);

// Adds a shard's share of the means over the n_pixels pixels of a batch.
void AddLoss(const ShardLoss& shard, double n_pixels, StepOutcome* outcome);

// Tells the occupancy grid what marching has seen.
void VisitCells(const ShardSamples& samples, OccupancyGrid* grid);

// Queries the density at a random point of every `stride`-th candidate cell, of other cells each `turn`, and
// tells the occupancy grid. seed and step choose the points.
void ProbeOccupancy(const std::vector<std::uint32_t>& candidates,
                    std::uint64_t stride,
                    std::uint64_t turn,
                    std::uint64_t seed,
                    std::uint64_t step,
                    SceneField* scene_field,
                    io::Workers* workers);

}  // namespace nerf
