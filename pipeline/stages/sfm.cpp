// `pipeline sfm`: ingest/ in, posed pinhole pictures out.
#include <fmt/format.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <utility>

#include "io/base/disk_room.h"
#include "io/base/error.h"
#include "io/base/json.h"
#include "io/base/median.h"
#include "io/base/quoting.h"
#include "io/image/image.h"
#include "io/image/mask.h"
#include "io/process/interrupt.h"
#include "io/process/parallel.h"
#include "io/scene/ply.h"
#include "io/scene/transforms.h"
#include "pipeline/stage/common_options.h"
#include "pipeline/stage/frames.h"
#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "pipeline/stage/stage_run.h"
#include "pipeline/stages/rank_session.h"
#include "pipeline/stages/stage_options.h"
#include "pipeline/stages/stages.h"
#include "sfm/reconstruction.h"
#include "sfm/scene/moving_subject.h"
#include "sfm/scene/undistort.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;
using io::Json;

std::vector<sfm::Picture> ReadPictures(const fs::path& ingest) {
  const fs::path path = ingest / "frames.json";
  std::vector<sfm::Picture> pictures;
  for (const KeptPicture& kept : ReadFrames(path).kept) {
    if (!fs::is_regular_file(ingest / "images" / kept.name)) {
      throw io::Error(io::ExitCode::kBadInput,
                      path.string() + ": names images/" + kept.name + ", which is missing",
                      "Run pipeline ingest again");
    }
    pictures.push_back({.name = kept.name,
                        .width = kept.width,
                        .height = kept.height,
                        .focal_px = kept.focal_px.value_or(0),
                        .camera_group = std::to_string(kept.camera_group),
                        .is_video_frame = kept.time_s.has_value(),
                        .rig = kept.panorama,
                        .heading_deg = kept.heading_deg});
  }
  return pictures;
}

// The frames' pictures, and the masks that were given for them.
void LocateFrames(const fs::path& images, const fs::path& masks, io::Scene* scene) {
  for (io::Frame& frame : scene->frames) {
    const fs::path mask = masks / fs::path(frame.image_path).replace_extension(".png");
    if (!masks.empty() && fs::exists(mask)) frame.mask_path = mask;
    frame.image_path = images / frame.image_path;
  }
}

// Gives the frames pictures and masks, below `folder`, of what moves while the background stands still: where
// it shows, they are transparent. What the frames' masks leave out stays so.
void CutOutSubjects(const fs::path& folder, int threads, io::Scene* scene, StageRun* stage) {
  const std::vector<sfm::MovingSubject> subjects = sfm::SubjectsOnTurntable(*scene, threads);
  if (subjects.empty()) {
    stage->Decide(
        "turntable: the subject cannot be told from the background; give masks of it (ingest --masks), or "
        "training blurs what surrounds it");
    return;
  }
  fs::create_directories(folder / "images");
  fs::create_directories(folder / "masks");
  std::vector<double> shares(subjects.size());
  io::ParallelFor(subjects.size(), threads, [&](std::size_t i) {
    io::ThrowIfInterrupted();
    io::Frame& frame = scene->frames[i];
    const fs::path name = frame.image_path.filename().replace_extension(".png");
    const io::Image picture = io::ReadImage(frame.image_path);
    const io::Mask used =
        frame.mask_path.empty() ? io::Mask() : io::ReadMask(frame.mask_path, picture.width, picture.height);
    const sfm::CutPicture cut = sfm::CutOut(picture, used, subjects[i]);
    io::WriteImage(folder / "images" / name, cut.image);
    io::WriteMask(folder / "masks" / name, cut.certain);
    frame.image_path = folder / "images" / name;
    frame.mask_path = folder / "masks" / name;
    shares[i] = subjects[i].Share();
  });
  stage->Decide(
      fmt::format("turntable: the subject is cut out of what stands still; it covers {:.0f} % of a picture",
                  100 * io::Median(std::move(shares))));
}

void WriteOutputs(const sfm::Reconstruction& result,
                  const io::Scene& scene,
                  const fs::path& folder,
                  int threads) {
  const io::Scene undistorted = sfm::UndistortScene(scene, folder, threads);
  io::WritePly(folder / "points.ply", undistorted.points);
  io::WriteTransforms(folder / "transforms.json", undistorted, "points.ply");
  io::WriteColmapModel(folder / "sparse" / "0", result.model);
  fs::rename(result.database, folder / "database.db");
  fs::rename(result.log, folder / "colmap.log");
}

void RecordFigures(const sfm::Reconstruction& result, std::size_t n_pictures, StageRun* stage) {
  const io::ColmapModel& model = result.model;
  stage->SetJson("images", n_pictures);
  stage->SetJson("registered", model.scene.frames.size());
  stage->SetJson("points", model.scene.points.size());
  stage->Set("mean_reprojection_error_px", model.mean_reprojection_error_px);
  stage->Set("mean_track_length", model.mean_track_length);
  stage->Set("triangulation_angle_deg", result.triangulation_angle_deg);
  stage->Set("camera_model", model.camera_model);
  stage->SetJson("turntable", result.turntable);
  stage->Set("stationary_share", result.stationary_share);
  Json cameras = Json::array();
  for (const io::Camera& c : model.scene.cameras) {
    cameras.push_back({{"w", c.width},
                       {"h", c.height},
                       {"fl_x", c.fl_x},
                       {"fl_y", c.fl_y},
                       {"cx", c.cx},
                       {"cy", c.cy},
                       {"k1", c.k1},
                       {"k2", c.k2},
                       {"p1", c.p1},
                       {"p2", c.p2}});
  }
  stage->SetJson("cameras", cameras);  // as estimated, before undistortion
  Json poses = Json::array();
  for (std::size_t i = 0; i < model.scene.frames.size(); ++i) {
    const sfm::PoseUncertainty& pose = result.uncertainty.poses[i];
    poses.push_back({{"name", model.scene.frames[i].image_path.string()},
                     {"rotation_sigma_deg", pose.rotation_deg},
                     {"centre_sigma_share", pose.centre}});
  }
  stage->SetJson("poses", poses);
  const sfm::ReconstructionTimes& times = result.times;
  stage->SetJson("wall_s_of",
                 Json{{"features", times.features_s},
                      {"matching", times.matching_s},
                      {"verifying", times.verifying_s},
                      {"mapping", times.mapping_s},
                      {"adjusting", times.adjusting_s}});
  Json unregistered = Json::array();
  for (const sfm::Unregistered& picture : result.unregistered) {
    const std::string cause = picture.refusal.Summary();
    unregistered.push_back({{"name", picture.name}, {"cause", cause}});
    std::fprintf(
        stderr, "sfm: not registered: %s (%s)\n", io::Printable(picture.name).c_str(), cause.c_str());
  }
  stage->SetJson("unregistered", unregistered);
  const std::string line = fmt::format(
      "{} of {} pictures registered, {} points, {:.2f} px mean error, median angle {:.1f} degrees",
      model.scene.frames.size(),
      n_pictures,
      model.scene.points.size(),
      model.mean_reprojection_error_px,
      result.triangulation_angle_deg);
  std::fprintf(stderr, "sfm: %s\n", line.c_str());
}

}  // namespace

int RunSfm(int argc, const char* const* argv) {
  return GuardedMain("pipeline sfm", [&] {
    CommonOptions common;
    sfm::ReconstructionOptions settings;
    Options options(
        "pipeline sfm",
        "Finds where each picture of DIR/ingest was taken (own matching, COLMAP, final adjustment) "
        "and undistorts it.");
    AddCommonOptions(&options, &common);
    AddSfmOptions(&options, &settings);
    if (!options.Parse(argc, argv)) return;
    const RankSession session("sfm", common.out, argc, argv);
    settings.threads = ResolvedThreads(common);
    settings.memory = ResolvedMemory(common);

    const fs::path ingest = fs::absolute(common.out).lexically_normal() / "ingest";
    const std::vector<sfm::Picture> pictures = ReadPictures(ingest);
    std::vector<fs::path> inputs = {ingest / "images", ingest / "frames.json"};
    if (fs::is_directory(ingest / "masks")) {
      settings.masks_folder = ingest / "masks";
      inputs.push_back(settings.masks_folder);
      if (settings.detector == "colmap")
        throw io::Error(io::ExitCode::kUsage, "--detector: colmap's takes no masks", "Use --detector opencv");
    }
    StageRun stage("sfm", common, options, inputs);
    if (stage.IsUpToDate()) return;

    const fs::path work = stage.folder() / "work";
    if (!stage.Leads()) {  // works for rank 0 as long as that needs it
      io::ToldWorks works;
      sfm::AddReconstructionWorks(ingest / "images", work, settings, &works);
      sfm::AddUndistortionWork(stage.folder(), settings.threads, &works);
      return io::Help(works);
    }
    const io::HelpOfOthers help;
    const sfm::Reconstruction result = [&] {
      try {
        return sfm::Reconstruct(pictures, ingest / "images", work, settings, [&](const std::string& line) {
          stage.Decide(line);
        });
      } catch (const io::Error&) {
        io::ThrowIfFull(work);  // which COLMAP reports as anything else
        throw;
      }
    }();
    io::Scene scene = result.model.scene;
    LocateFrames(ingest / "images", settings.masks_folder, &scene);
    if (result.turntable) CutOutSubjects(work / "subjects", settings.threads, &scene, &stage);
    WriteOutputs(result, scene, stage.folder(), settings.threads);
    fs::remove_all(work);
    stage.AddChildUse(result.colmap_cpu_s, result.peak_rss_bytes);
    RecordFigures(result, pictures.size(), &stage);
    stage.Finish();
  });
}

}  // namespace pipeline
