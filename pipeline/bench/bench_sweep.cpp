// `pipeline bench sfm --images`: what each knob of structure-from-motion costs and brings.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <map>
#include <optional>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/base/owned_folder.h"
#include "io/image/image_size.h"
#include "io/image/photo_tags.h"
#include "io/process/interrupt.h"
#include "io/process/resource_meter.h"
#include "pipeline/bench/bench.h"
#include "pipeline/bench/bench_colmap.h"
#include "pipeline/bench/bench_table.h"
#include "pipeline/bench/true_poses.h"
#include "pipeline/ingest/picture_source.h"
#include "pipeline/report/plot_svg.h"
#include "sfm/reconstruction.h"
#include "sfm/scene/pose_error.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// One run; what could not be measured is NaN.
struct Run {
  std::string method, parameters, label;  // label: in the plot
  std::string failure;                    // empty: there is a model
  std::size_t pictures = 0;
  io::ResourceUse use;
  sfm::ReconstructionTimes times;  // of our own runs
  double registered = 0, points = kUnknown, track_length = kUnknown, reprojection_px = kUnknown;
  sfm::PoseError error;  // where the truth is known
};

// Pictures as they are: neither COLMAP nor the benchmark turns or re-encodes them.
std::vector<sfm::Picture> ReadPictures(const fs::path& folder) {
  std::vector<sfm::Picture> pictures;
  for (const fs::path& file : FindPictures(folder).files) {
    const io::ImageSize size = io::ReadImageSize(file);
    const io::PhotoTags tags = io::ReadPhotoTags(ReadPictureFile(file));
    if (tags.orientation != 1) {
      throw io::Error(io::ExitCode::kBadInput,
                      file.string() + ": lies on its side (EXIF orientation)",
                      "Run pipeline ingest and give its folder ingest/images");
    }
    const double focal = io::FocalPixels(tags, size.width, size.height).value_or(0);
    pictures.push_back({.name = file.filename().string(),
                        .width = size.width,
                        .height = size.height,
                        .focal_px = focal,
                        .camera_group = fmt::format("{}/{}/{}", tags.make, tags.model, std::lround(focal))});
  }
  return pictures;
}

bool ShareOneCamera(const std::vector<sfm::Picture>& pictures) {
  for (const sfm::Picture& p : pictures) {
    if (p.width != pictures[0].width || p.height != pictures[0].height ||
        p.camera_group != pictures[0].camera_group)
      return false;
  }
  return true;
}

// Fills in the model that `reconstruct` returns, or why there is none. Only a missing program or the user
// ends the sweep.
void Measure(const std::function<io::ColmapModel(io::ResourceUse*)>& reconstruct,
             const std::optional<io::Scene>& truth,
             Run* run) {
  io::ThrowIfInterrupted();
  std::fprintf(stderr, "bench: %s %s\n", run->method.c_str(), run->parameters.c_str());
  try {
    const io::ColmapModel model = reconstruct(&run->use);
    run->registered = static_cast<double>(model.scene.frames.size());
    run->points = static_cast<double>(model.scene.points.size());
    run->track_length = model.mean_track_length;
    run->reprojection_px = model.mean_reprojection_error_px;
    if (truth) run->error = sfm::ComparePoses(model.scene, *truth);
  } catch (const io::Error& error) {
    if (error.code() == io::ExitCode::kUsage) throw;
    run->failure = error.what();
  }
}

// `count` of the pictures, evenly spaced; all of them for 0.
std::vector<sfm::Picture> Choose(const std::vector<sfm::Picture>& pictures, int count) {
  const std::size_t n = pictures.size(), wanted = static_cast<std::size_t>(count);
  if (count == 0 || wanted >= n) return pictures;
  std::vector<sfm::Picture> chosen;
  for (std::size_t i = 0; i < wanted; ++i) chosen.push_back(pictures[i * n / wanted]);
  return chosen;
}

Run RunOnce(const SweepOptions& options,
            const std::vector<sfm::Picture>& pictures,
            const sfm::ReconstructionOptions& settings,
            const std::optional<io::Scene>& truth) {
  const std::string features = std::to_string(settings.features),
                    size = settings.max_image_size > 0 ? std::to_string(settings.max_image_size) : "full";
  Run run{.method = "ours",
          .parameters = fmt::format("pictures={} features={} size={} matching={} detector={}",
                                    pictures.size(),
                                    features,
                                    size,
                                    settings.matching,
                                    settings.detector),
          .label = features + "/" + size + "/" + settings.matching.substr(0, 1) +
                   (settings.detector == "opencv" ? "" : "/" + settings.detector),
          .pictures = pictures.size()};
  const fs::path work = options.out / "work";
  Measure(
      [&](io::ResourceUse* use) {
        io::RecreateOwnedFolder(work);
        const io::ResourceMeter meter;
        try {
          const sfm::Reconstruction found =
              sfm::Reconstruct(pictures, options.images, work, settings, [](const std::string&) {});
          *use = meter.Use();
          use->peak_rss_bytes = std::max(use->peak_rss_bytes, found.peak_rss_bytes);
          run.times = found.times;
          return found.model;
        } catch (...) {
          *use = meter.Use();
          throw;
        }
      },
      truth,
      &run);
  io::RemoveOwnedFolder(work);
  return run;
}

std::vector<Run> RunOurs(const SweepOptions& options,
                         const std::vector<sfm::Picture>& pictures,
                         const std::optional<io::Scene>& truth) {
  std::vector<Run> runs;
  // No further attempts: they would hide what the knobs do.
  sfm::ReconstructionOptions settings{.retry_minutes = 0, .threads = options.threads};
  for (const int count : options.pictures) {
    const std::vector<sfm::Picture> chosen = Choose(pictures, count);
    for (const std::string& detector : options.detectors) {
      settings.detector = detector;
      for (const std::string& matching : options.matching) {
        settings.matching = matching;
        for (const int size : options.sizes) {
          settings.max_image_size = size;
          for (const int features : options.features) {
            settings.features = features;
            runs.push_back(RunOnce(options, chosen, settings, truth));
          }
        }
      }
    }
  }
  return runs;
}

void PrintRuns(const std::vector<Run>& runs) {
  std::printf("%-16s %-76s %8s %8s %7s %9s %8s %6s %8s %9s %9s %10s\n",
              "method",
              "parameters",
              "wall s",
              "CPU s",
              "MiB",
              "pictures",
              "points",
              "track",
              "error px",
              "rot med",
              "rot max",
              "centre %");
  for (const Run& run : runs) {
    std::printf("%-16s %-76s %8.1f %8.1f %7.0f %4.0f/%-4zu %8.0f %6.2f %8.3f %9.4f %9.4f %10.4f %s\n",
                run.method.c_str(),
                run.parameters.c_str(),
                run.use.wall_s,
                run.use.cpu_s,
                static_cast<double>(run.use.peak_rss_bytes) / (1 << 20),
                run.registered,
                run.pictures,
                run.points,
                run.track_length,
                run.reprojection_px,
                run.error.rotation_median_deg,
                run.error.rotation_max_deg,
                100 * run.error.centre_rmse,
                run.failure.substr(0, run.failure.find('\n')).c_str());
  }
}

std::vector<BenchValue> ToValues(const std::vector<Run>& runs, const fs::path& images) {
  std::vector<BenchValue> values;
  for (const Run& run : runs) {
    const auto add = [&](const char* metric, const char* unit, double value) {
      values.push_back({run.method + " on " + images.string(), run.parameters, metric, unit, value});
    };
    add("wall", "s", run.use.wall_s);
    add("cpu", "s", run.use.cpu_s);
    if (run.method == "ours") {
      add("wall_features", "s", run.times.features_s);
      add("wall_matching", "s", run.times.matching_s);
      add("wall_verifying", "s", run.times.verifying_s);
      add("wall_mapping", "s", run.times.mapping_s);
      add("wall_adjusting", "s", run.times.adjusting_s);
    }
    add("peak_rss", "byte", static_cast<double>(run.use.peak_rss_bytes));
    add("registered", "picture", run.registered);
    add("points", "point", run.points);
    add("track_length", "picture", run.track_length);
    add("reprojection_error", "px", run.reprojection_px);
    add("rotation_median", "deg", run.error.rotation_median_deg);
    add("rotation_max", "deg", run.error.rotation_max_deg);
    add("centre_rmse", "extent", run.error.centre_rmse);
    add("centre_max", "extent", run.error.centre_max);
    add("centre_rmse", "truth unit", run.error.centre_rmse * run.error.extent);
    for (std::size_t k = 0; k < sfm::kAucDegrees.size(); ++k) {
      values.push_back({run.method + " on " + images.string(),
                        run.parameters,
                        "auc_" + CsvNumber(sfm::kAucDegrees[k]) + "deg",
                        "1",
                        run.error.auc[k]});
    }
  }
  return values;
}

void WritePlot(const fs::path& path, const std::vector<Run>& runs, bool has_truth) {
  const auto plot = [&](const std::string& y_label, const std::function<double(const Run&)>& error) {
    std::map<bool, PlotSeries> by_ours;
    by_ours[true].label = "ours (features/size/matching)";
    by_ours[false].label = "COLMAP";
    for (const Run& run : runs) {
      PlotSeries& series = by_ours[run.method == "ours"];
      series.x.push_back(run.use.cpu_s);
      series.y.push_back(error(run));
      series.point_labels.push_back(run.label);
    }
    return PlotSvg(
        {by_ours[true], by_ours[false]},
        {.x_label = "CPU seconds", .y_label = y_label, .log_y = true, .log_x = true, .scatter = true});
  };
  std::vector<std::string> plots;
  if (has_truth) {
    plots.push_back(
        plot("rotation error, median [deg]", [](const Run& r) { return r.error.rotation_median_deg; }));
    plots.push_back(
        plot("centre error, RMS [% of the extent]", [](const Run& r) { return 100 * r.error.centre_rmse; }));
  } else {
    plots.push_back(plot("reprojection error [px]", [](const Run& r) { return r.reprojection_px; }));
  }
  io::WriteFileAtomically(path, StandaloneSvg(plots));
}

// Seconds of each part against the number of pictures.
void WriteGrowthPlot(const fs::path& path, const std::vector<Run>& runs) {
  std::vector<PlotSeries> series;
  const auto add = [&](const char* label, const std::function<double(const Run&)>& seconds) {
    PlotSeries line{.label = label};
    for (const Run& run : runs) {
      if (run.method != "ours" || !run.failure.empty()) continue;
      line.x.push_back(static_cast<double>(run.pictures));
      line.y.push_back(seconds(run));
    }
    series.push_back(std::move(line));
  };
  add("total", [](const Run& r) { return r.use.wall_s; });
  add("features", [](const Run& r) { return r.times.features_s; });
  add("matching", [](const Run& r) { return r.times.matching_s; });
  add("verifying", [](const Run& r) { return r.times.verifying_s; });
  add("mapping", [](const Run& r) { return r.times.mapping_s; });
  add("adjusting", [](const Run& r) { return r.times.adjusting_s; });
  io::WriteFileAtomically(
      path,
      StandaloneSvg({PlotSvg(
          series, {.x_label = "pictures", .y_label = "wall seconds", .log_y = true, .log_x = true})}));
}

}  // namespace

void RunSweep(const SweepOptions& options) {
  const std::vector<sfm::Picture> pictures = ReadPictures(options.images);
  std::optional<io::Scene> truth;
  if (!options.truth.empty()) truth = ReadTruePoses(options.truth);

  std::vector<Run> runs;
  if (options.colmap) {
    for (const ColmapPreset& preset : ColmapPresets()) {
      Run run{.method = preset.name, .label = preset.name, .pictures = pictures.size()};
      if (preset.features > 0)
        run.parameters = fmt::format("features={} size={}", preset.features, preset.size);
      Measure(
          [&](io::ResourceUse* use) {
            return RunColmapPreset(preset,
                                   fs::absolute(options.images),
                                   ShareOneCamera(pictures),
                                   fs::absolute(options.out) / "work",
                                   use);
          },
          truth,
          &run);
      runs.push_back(std::move(run));
    }
  }
  for (Run& run : RunOurs(options, pictures, truth)) runs.push_back(std::move(run));
  PrintRuns(runs);
  WriteBenchTable(options.out / "results.csv", ToValues(runs, options.images));
  WritePlot(options.out / "work_precision.svg", runs, truth.has_value());
  if (options.pictures.size() > 1) WriteGrowthPlot(options.out / "cost_growth.svg", runs);
}

}  // namespace pipeline
