#include "sfm/rigs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "io/base/median.h"
#include "sfm/bundle/bundle_adjustment.h"
#include "sfm/bundle/observation_filter.h"
#include "sfm/second_look.h"

namespace sfm {
namespace {

constexpr double kPerDegree = std::numbers::pi / 180;
// Views posed alone lie within a few tenths of a degree of one another; wrong poses are off by much more.
constexpr double kMaxTurnDeg = 2;

std::size_t AsIndex(int i) { return static_cast<std::size_t>(i); }

Eigen::Matrix3d CamFromRig(const Picture& picture) {
  return Eigen::AngleAxisd(picture.heading_deg * kPerDegree, Eigen::Vector3d::UnitY()).toRotationMatrix();
}

using Rigs = std::map<std::string, std::vector<const Picture*>>;

Rigs RigsOf(const std::vector<Picture>& pictures) {
  Rigs rigs;
  for (const Picture& picture : pictures) {
    if (!picture.rig.empty()) rigs[picture.rig].push_back(&picture);
  }
  return rigs;
}

std::map<std::string, std::size_t> FramesByName(const io::Scene& scene) {
  std::map<std::string, std::size_t> frames;
  for (std::size_t i = 0; i < scene.frames.size(); ++i) frames[scene.frames[i].image_path.string()] = i;
  return frames;
}

// Of each frame, the points that it observes.
std::vector<std::vector<Eigen::Vector3d>> PointsOfFrames(const io::ColmapModel& model) {
  std::vector<std::vector<Eigen::Vector3d>> points(model.scene.frames.size());
  for (const io::Observation& observation : model.observations)
    points[AsIndex(observation.frame_index)].push_back(
        model.scene.points[AsIndex(observation.point_index)].xyz);
  return points;
}

io::Rigid3d PoseBeside(const io::Rigid3d& leader_pose, const Picture& leader, const Picture& other) {
  return {leader_pose.rotation * CamFromRig(leader) * CamFromRig(other).transpose(), leader_pose.translation};
}

double AngleDeg(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return Eigen::AngleAxisd(a.transpose() * b).angle() / kPerDegree;
}

// Whether a view that was posed alone, and sees these points, stands and looks nearly as its panorama says.
bool Agrees(const io::Rigid3d& alone, const io::Rigid3d& in_rig, const std::vector<Eigen::Vector3d>& points) {
  if (AngleDeg(alone.rotation, in_rig.rotation) > kMaxTurnDeg) return false;
  std::vector<double> depths;
  const io::Rigid3d cam_from_world = in_rig.Inverse();
  for (const Eigen::Vector3d& point : points) depths.push_back(-(cam_from_world * point).z());
  if (depths.empty() || *std::min_element(depths.begin(), depths.end()) <= 0) return false;
  return (alone.translation - in_rig.translation).norm() <=
         std::tan(kMaxTurnDeg * kPerDegree) * io::Median(depths);
}

// Views as they were posed alone.
class PosedViews {
 public:
  explicit PosedViews(const io::ColmapModel& model)
      : model_(model), frames_(FramesByName(model.scene)), points_(PointsOfFrames(model)) {}

  bool IsPosed(const Picture& view) const { return frames_.count(view.name) > 0; }
  const io::Rigid3d& Pose(const Picture& view) const {
    return model_.scene.frames[frames_.at(view.name)].world_from_cam;
  }
  std::size_t PointCount(const Picture& view) const { return points_[frames_.at(view.name)].size(); }
  io::Rigid3d PoseBy(const Picture& leader, const Picture& view) const {
    return PoseBeside(Pose(leader), leader, view);
  }
  bool Agree(const Picture& leader, const Picture& view) const {
    return Agrees(Pose(view), PoseBy(leader, view), points_[frames_.at(view.name)]);
  }

 private:
  const io::ColmapModel& model_;
  std::map<std::string, std::size_t> frames_;
  std::vector<std::vector<Eigen::Vector3d>> points_;
};

using Leaders = std::map<std::string, const Picture*>;

// The posed view of each rig that most others agree with, of several the one with most points; rigs without
// one are left out.
Leaders LeadersOf(const Rigs& rigs, const PosedViews& posed) {
  Leaders leaders;
  for (const auto& [name, views] : rigs) {
    std::pair<std::size_t, std::size_t> most;
    for (const Picture* view : views) {
      if (!posed.IsPosed(*view) || posed.PointCount(*view) == 0) continue;
      std::size_t n_agreeing = 1;
      for (const Picture* other : views)
        n_agreeing += other != view && posed.IsPosed(*other) && posed.Agree(*view, *other);
      const std::pair support(n_agreeing, posed.PointCount(*view));
      if (support > most) most = support, leaders[name] = view;
    }
  }
  return leaders;
}

// Views whose own pose the leader of their rig contradicts; `turns` gets the angles of the others.
std::set<std::string> Contradicted(const Rigs& rigs,
                                   const Leaders& leaders,
                                   const PosedViews& posed,
                                   std::vector<double>* turns) {
  std::set<std::string> contradicted;
  for (const auto& [name, leader] : leaders) {
    for (const Picture* view : rigs.at(name)) {
      if (view == leader || !posed.IsPosed(*view)) continue;
      if (posed.Agree(*leader, *view)) {
        turns->push_back(AngleDeg(posed.Pose(*view).rotation, posed.PoseBy(*leader, *view).rotation));
      } else {
        contradicted.insert(view->name);
      }
    }
  }
  return contradicted;
}

// Poses every view by its leader, gives it the camera it was cut out with, and adds those that are missing.
// Returns AdjustmentOptions::moves_with.
std::vector<std::size_t> PoseAll(const Rigs& rigs, const Leaders& leaders, io::ColmapModel* model) {
  io::Scene& scene = model->scene;
  auto frames = FramesByName(scene);
  std::vector<std::size_t> moves_with(scene.frames.size());
  for (std::size_t i = 0; i < moves_with.size(); ++i) moves_with[i] = i;
  std::map<std::pair<int, int>, int> cameras;  // by size
  for (const auto& [name, leader] : leaders) {
    const std::size_t leading = frames.at(leader->name);
    for (const Picture* view : rigs.at(name)) {
      const auto [camera, is_new] =
          cameras.emplace(std::pair(view->width, view->height), static_cast<int>(scene.cameras.size()));
      if (is_new) {
        scene.cameras.push_back({.width = view->width,
                                 .height = view->height,
                                 .fl_x = view->focal_px,
                                 .fl_y = view->focal_px,
                                 .cx = view->width / 2.0,
                                 .cy = view->height / 2.0});
      }
      const auto [frame, is_added] = frames.emplace(view->name, scene.frames.size());
      if (is_added) {
        scene.frames.push_back({.image_path = view->name});
        moves_with.push_back(leading);
      }
      const io::Rigid3d pose = PoseBeside(scene.frames[leading].world_from_cam, *leader, *view);
      scene.frames[frame->second].world_from_cam = pose;
      scene.frames[frame->second].camera_index = camera->second;
      moves_with[frame->second] = leading;
    }
  }
  return moves_with;
}

}  // namespace

int PosedWithRigs(const std::vector<Picture>& pictures, const std::set<std::string>& posed) {
  std::set<std::string> rigs;
  for (const Picture& picture : pictures) {
    if (!picture.rig.empty() && posed.count(picture.name) > 0) rigs.insert(picture.rig);
  }
  return static_cast<int>(std::count_if(pictures.begin(), pictures.end(), [&](const Picture& picture) {
    return posed.count(picture.name) > 0 || rigs.count(picture.rig) > 0;
  }));
}

RigReport JoinRigs(const std::vector<Picture>& pictures,
                   const std::string& title,
                   io::ColmapModel* model,
                   BundleUncertainty* uncertainty) {
  const Rigs rigs = RigsOf(pictures);
  const PosedViews posed(*model);
  const Leaders leaders = LeadersOf(rigs, posed);
  if (leaders.empty()) return {};
  std::vector<double> turns;
  const std::set<std::string> contradicted = Contradicted(rigs, leaders, posed, &turns);
  io::ColmapModel joined = contradicted.empty() ? *model : WithoutFrames(*model, contradicted);
  const auto n_before = joined.scene.frames.size();
  const std::vector<std::size_t> moves_with = PoseAll(rigs, leaders, &joined);
  joined = WithoutFrames(joined, {});  // nor the cameras that no view has any more
  const std::vector<FreeIntrinsics> held(joined.scene.cameras.size());
  AdjustBundle(&joined, {.free = held, .moves_with = moves_with, .title = title});
  RemoveWeakObservations(&joined);
  *uncertainty = EstimateUncertainty(joined, held, true, moves_with);
  *model = std::move(joined);
  return {.n_rigs = static_cast<int>(leaders.size()),
          .n_added = static_cast<int>(model->scene.frames.size() - n_before),
          .rotation_deg = turns.empty() ? 0 : io::Median(turns)};
}

}  // namespace sfm
