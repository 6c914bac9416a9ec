#include "nerf/steps/field_training.h"

#include <algorithm>

#include "io/base/check.h"
#include "io/base/error.h"
#include "io/base/random.h"
#include "io/process/ranks.h"

namespace nerf {
namespace {

// Fills what other ranks computed of `values`: the tasks of each are consecutive, `length` values long but
// for the last one. False when a rank is lost or this one is to stop.
bool ExchangeRanges(int n_tasks, std::size_t length, std::vector<float>* values) {
  io::Ranks& ranks = io::AllRanks();
  const auto begin_of = [&](int rank) {
    const auto task = static_cast<std::size_t>(io::FirstTask(n_tasks, rank, ranks.size()));
    return values->data() + std::min(values->size(), task * length);
  };
  std::vector<std::string> all;
  try {
    all = ranks.AllGather({reinterpret_cast<const char*>(begin_of(ranks.rank())),
                           reinterpret_cast<const char*>(begin_of(ranks.rank() + 1))});
  } catch (const io::Interrupted&) {
    return false;
  }
  for (int r = 0; r < ranks.size(); ++r) {
    const std::string& bytes = all[static_cast<std::size_t>(r)];
    PIPELINE_CHECK_EQ(bytes.size(), static_cast<std::size_t>(begin_of(r + 1) - begin_of(r)) * sizeof(float));
    bytes.copy(reinterpret_cast<char*>(begin_of(r)), bytes.size());
  }
  return true;
}

}  // namespace

int NextRayCount(int n_rays, std::uint64_t n_samples, int wanted, int low, int high) {
  const double n =
      static_cast<double>(n_rays) * wanted / static_cast<double>(std::max<std::uint64_t>(n_samples, 1));
  return static_cast<int>(std::clamp(std::clamp(n, 0.5 * n_rays, 2.0 * n_rays), double(low), double(high)));
}

void AddLoss(const ShardLoss& shard, double n_pixels, StepOutcome* outcome) {
  outcome->loss += shard.loss / n_pixels;
  outcome->opacity += shard.opacity / n_pixels;
  outcome->squared_error += shard.squared_error / (3.0 * n_pixels);
}

void VisitCells(const ShardSamples& samples, OccupancyGrid* grid) {
  for (std::size_t i = 0; i < samples.visited_cell.size(); ++i)
    grid->Visit(samples.visited_cell[i], samples.visited_sigma[i]);
}

void ProbeOccupancy(const std::vector<std::uint32_t>& candidates,
                    std::uint64_t stride,
                    std::uint64_t turn,
                    std::uint64_t seed,
                    std::uint64_t step,
                    SceneField* scene_field,
                    io::Workers* workers) {
  OccupancyGrid& grid = scene_field->grid;
  std::vector<std::uint32_t> cells;
  for (std::size_t i = turn % stride; i < candidates.size(); i += stride) cells.push_back(candidates[i]);
  std::vector<float> sigma(cells.size());
  constexpr std::size_t kTask = 4096;
  const float size = 1.f / static_cast<float>(grid.resolution());
  const io::Ranks& ranks = io::AllRanks();
  const int n_tasks = static_cast<int>((cells.size() + kTask - 1) / kTask);
  const auto query = [&](int task) {
    const std::size_t first = static_cast<std::size_t>(task) * kTask,
                      last = std::min(cells.size(), first + kTask);
    Samples points;
    for (std::size_t i = first; i < last; ++i) {
      io::Random random(seed, io::Stream::kProbe, step, 3 * i);
      const std::array<float, 3> centre = grid.CellCentre(cells[i]);
      points.x.push_back(centre[0] + size * (random.Uniform() - 0.5f));
      points.y.push_back(centre[1] + size * (random.Uniform() - 0.5f));
      points.z.push_back(centre[2] + size * (random.Uniform() - 0.5f));
    }
    scene_field->field->QueryDensity(points, &sigma[first]);
  };
  const int first_task = io::FirstTask(n_tasks, ranks.rank(), ranks.size()),
            end_task = io::FirstTask(n_tasks, ranks.rank() + 1, ranks.size());
  workers->Run(end_task - first_task, [&](int task, int) { query(first_task + task); });
  // The field has taken this step: a checkpoint that knows only half of it would continue elsewhere.
  if (ranks.AreSeveral() && !ExchangeRanges(n_tasks, kTask, &sigma))
    workers->Run(n_tasks, [&](int task, int) { query(task); });
  for (std::size_t i = 0; i < cells.size(); ++i) grid.Probe(cells[i], sigma[i]);
}

}  // namespace nerf
