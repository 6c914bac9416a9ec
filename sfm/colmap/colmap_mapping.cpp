// The steps that make, continue, join and complete models.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <numeric>

#include "io/base/atomic_file.h"
#include "io/base/packed.h"
#include "io/process/parallel.h"
#include "io/process/progress.h"
#include "io/process/ranks.h"
#include "io/scene/colmap_model.h"
#include "sfm/colmap/colmap_messages.h"
#include "sfm/colmap/colmap_step.h"
#include "sfm/colmap/log_progress.h"

namespace sfm {
namespace {

namespace fs = std::filesystem;

// Limits against hanging: ten times what the slowest supported machine was seen to need.
constexpr double kMappingLimitS = 300, kMappingLimitPerPictureS = 20;
// In the logs, once per picture; the mapper's first two go without.
constexpr const char *kRegistering = "Registering image #", *kTriangulating = "Triangulating image #";

void Append(std::vector<std::string>* arguments, const std::vector<std::string>& more) {
  arguments->insert(arguments->end(), more.begin(), more.end());
}

// Half of COLMAP's defaults of 100 inliers, 16 degrees and 30 inliers.
const std::vector<std::string> kRelaxed = {"--Mapper.init_min_num_inliers",
                                           "50",
                                           "--Mapper.init_min_tri_angle",
                                           "8",
                                           "--Mapper.abs_pose_min_num_inliers",
                                           "15"};

// Of a rank that does a part.
std::string OwnFolder() { return fmt::format("rank{}", io::AllRanks().rank()); }

std::vector<fs::path> ModelFolders(const fs::path& folder) {
  std::vector<fs::path> models;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.is_directory()) models.push_back(entry.path());
  }
  std::sort(models.begin(), models.end());
  return models;
}

}  // namespace

Colmap::Step Colmap::MapperStep(const std::string& command,
                                const fs::path& images_folder,
                                const fs::path& output,
                                int n_pictures) const {
  fs::remove_all(output);
  fs::create_directories(output);
  Step step{.command = command,
            .arguments = {"--database_path",
                          database_.string(),
                          "--image_path",  // must exist, even where no colours are read
                          (images_folder.empty() ? work_folder_ : images_folder).string(),
                          "--output_path",
                          output.string(),
                          "--Mapper.extract_colors",
                          images_folder.empty() ? "0" : "1",
                          flags_.mapper_threads,
                          "1"},
            .log = log_path_,
            .limit_s = kMappingLimitS + kMappingLimitPerPictureS * n_pictures,
            .may_find_nothing = true};
  Append(&step.arguments, flags_.mapper_options);
  if (take_two_view_tracks_) Append(&step.arguments, flags_.two_view_tracks);
  return step;
}

std::vector<fs::path> Colmap::Map(const fs::path& images_folder, int n_pictures, bool relaxed) {
  const fs::path sparse = work_folder_ / "sparse";
  LogProgress progress(log_path_, "sfm: mapping", kRegistering, 2, n_pictures);
  Step step = MapperStep("mapper", images_folder, sparse, n_pictures);
  step.on_tick = [&] { progress.Tick(); };
  if (relaxed) Append(&step.arguments, kRelaxed);
  Run(step);
  progress.Finish();
  return ModelFolders(sparse);
}

io::TaskResults Colmap::MapSome(const fs::path& images_folder,
                                const Blocks& blocks,
                                bool relaxed,
                                const std::vector<std::size_t>& tasks) {
  std::size_t total = 0;
  for (const std::size_t i : tasks) total += blocks[i].size();
  io::Progress progress("sfm: mapping");
  std::vector<int> done(tasks.size(), 0);
  const auto show = [&](double most) {
    const int sum = std::accumulate(done.begin(), done.end(), 0);
    progress.Update(std::min(most, sum / static_cast<double>(total)),
                    fmt::format("{} blocks of pictures", tasks.size()));
  };
  io::TaskResults models(tasks.size());
  io::ParallelFor(tasks.size(), threads_, [&](std::size_t i) {
    const std::vector<std::string>& block = blocks[tasks[i]];
    const std::string stem = fmt::format("block{}", tasks[i]);
    const fs::path list = work_folder_ / (stem + ".txt"), sparse = work_folder_ / stem;
    io::WriteFileAtomically(list, fmt::format("{}\n", fmt::join(block, "\n")));
    Step step = MapperStep("mapper", images_folder, sparse, static_cast<int>(block.size()));
    Append(&step.arguments, {"--image_list_path", list.string()});
    if (relaxed) Append(&step.arguments, kRelaxed);
    step.log = work_folder_ / (stem + ".log");
    LogCounter counter(step.log, kRegistering);
    step.on_tick = [&] {
      const std::lock_guard lock(mutex_);
      done[i] = counter.Count();
      show(0.99);
    };
    Run(step);
    std::vector<std::string> folders;
    for (const fs::path& folder : ModelFolders(sparse))
      folders.push_back(folder.lexically_relative(SharedFolder()));
    models[i] = io::Packer().Add(folders).Take();
    fs::remove(list);
    const std::lock_guard lock(mutex_);
    done[i] = static_cast<int>(block.size());
    show(1);
  });
  return models;
}

std::vector<std::vector<fs::path>> Colmap::MapBlocks(const fs::path& images_folder,
                                                     const Blocks& blocks,
                                                     bool relaxed) {
  const auto tell = [&] {
    return TellMapping({.folder = work_folder_.filename(),
                        .blocks = blocks,
                        .has_images = !images_folder.empty(),
                        .relaxed = relaxed,
                        .take_two_view_tracks = take_two_view_tracks_});
  };
  std::vector<std::vector<fs::path>> models;
  for (const std::string& packed :
       io::ShareOut(kMapWork, blocks.size(), tell, [&](const std::vector<std::size_t>& tasks) {
         return MapSome(images_folder, blocks, relaxed, tasks);
       })) {
    models.emplace_back();
    for (const std::string& folder : io::Unpacker(packed).Take<std::vector<std::string>>())
      models.back().push_back(SharedFolder() / folder);
  }
  return models;
}

void Colmap::AddWorks(const fs::path& work_folder,
                      const fs::path& images_folder,
                      int threads,
                      io::ToldWorks* works) {
  (*works)[kMapWork] = [=](const std::string& told, const std::vector<std::size_t>& tasks) {
    const MappingMessage message = ToldMapping(told);
    const fs::path folder = work_folder / message.folder;
    Colmap colmap(folder / OwnFolder(), threads, folder / kDatabase);
    colmap.TakeTwoViewTracks(message.take_two_view_tracks);
    return colmap.MapSome(message.has_images ? images_folder : "", message.blocks, message.relaxed, tasks);
  };
}

std::optional<fs::path> Colmap::Continue(const fs::path& images_folder,
                                         const fs::path& model,
                                         int n_pictures,
                                         bool relaxed) {
  const fs::path output = work_folder_ / "continued";
  Step step = MapperStep("mapper", images_folder, output, n_pictures);
  // By its defaults a picture that does not fit is tried 200 times over, and then as the start of other
  // models.
  Append(&step.arguments,
         {"--input_path", model.string(), "--Mapper.multiple_models", "0", "--Mapper.init_num_trials", "1"});
  if (relaxed) Append(&step.arguments, kRelaxed);
  if (!Run(step) || !io::IsColmapModel(output)) return std::nullopt;
  return output;
}

std::optional<fs::path> Colmap::Merge(const fs::path& a, const fs::path& b) {
  const fs::path merged = work_folder_ / ("merged_" + a.filename().string() + "_" + b.filename().string());
  fs::create_directories(merged);
  const bool ok =
      Run({.command = "model_merger",
           .arguments =
               {"--input_path1", a.string(), "--input_path2", b.string(), "--output_path", merged.string()},
           .log = log_path_,
           .limit_s = kMappingLimitS,
           .may_find_nothing = true});
  if (!ok || !io::IsColmapModel(merged)) return std::nullopt;
  return merged;
}

std::optional<fs::path> Colmap::Triangulate(const fs::path& images_folder,
                                            const fs::path& poses,
                                            int n_pictures) {
  const fs::path output = work_folder_ / "triangulated";
  Step step = MapperStep("point_triangulator", images_folder, output, n_pictures);
  Append(&step.arguments, {"--input_path", poses.string(), "--clear_points", "1"});
  LogProgress progress(log_path_, "sfm: triangulating", kTriangulating, 0, n_pictures);
  step.on_tick = [&] { progress.Tick(); };
  if (!Run(step) || !io::IsColmapModel(output)) return std::nullopt;
  progress.Finish();
  return output;
}

}  // namespace sfm
