// Meshes whose distance from the true surface is known.
#include "samples/mesh_truth.h"

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "samples/room_paint.h"
#include "samples/trajectory.h"
#include "tests/support/files/temp_dir.h"

namespace {

using samples::Vec3;

TEST(DistanceToSurface, IsThatOfWhatIsNear) {
  EXPECT_NEAR(samples::DistanceToSurface({1.2, 0.4, 0.01}), 0.01, 1e-9);      // table top
  EXPECT_NEAR(samples::DistanceToSurface({-1.2, 0.4, -0.005}), 0.005, 1e-9);  // in it
  EXPECT_NEAR(samples::DistanceToSurface({0, 1.55, -0.04}), 0.05, 1e-9);      // beside its edge
  EXPECT_NEAR(samples::DistanceToSurface({0.25, 0, -0.5}), 0.05, 1e-9);       // beside its leg
  EXPECT_NEAR(samples::DistanceToSurface({3, 0, samples::kFloorZ + 0.1}), 0.1, 1e-9);
  EXPECT_NEAR(samples::DistanceToSurface({samples::kRoomRadius - 0.3, 0, 1}), 0.3, 1e-9);
  // Along the normal of the owl, whose function underestimates.
  const samples::Solid owl = samples::FigurineSolids()[0];
  for (const Vec3& from :
       {Vec3(0.3, -0.8, 0.2), Vec3(-0.5, 0.5, -0.3), Vec3(0.1, -0.9, 0.1), Vec3(0.6, 0.5, -0.1)}) {
    Vec3 p = owl.centre + owl.radius * from;
    const Vec3 inwards = (owl.centre - p).normalized();
    for (int i = 0; i < 1000 && owl.distance(p) > 1e-6; ++i) p += 0.5 * owl.distance(p) * inwards;
    Vec3 normal;
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3 step = 1e-5 * Vec3::Unit(axis);
      normal[axis] = owl.distance(p + step) - owl.distance(p - step);
    }
    EXPECT_LT(samples::DistanceToSurface(p), 1e-4);
    EXPECT_NEAR(samples::DistanceToSurface(p + 0.005 * normal.normalized()), 0.005, 5e-4) << from.transpose();
  }
}

// The table top raised by `offset`, cut off at x = right, as a mesh of the sample's own frame.
io::Mesh RaisedTable(float offset, float right) {
  io::Mesh mesh;
  const float r = static_cast<float>(samples::kTableRadius);
  mesh.positions = {{-r, -r, offset}, {right, -r, offset}, {right, r, offset}, {-r, r, offset}};
  mesh.normals.assign(4, Eigen::Vector3f::UnitZ());
  mesh.colours.resize(4);
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

io::Scene TrueScene() {
  io::Scene scene;
  scene.cameras = {{.width = 96, .height = 72, .fl_x = 82, .fl_y = 82, .cx = 48, .cy = 36}};
  for (const io::Rigid3d& pose : samples::OrbitPoses(12, 1))
    scene.frames.push_back({"photos/" + std::to_string(scene.frames.size()) + ".jpg", 0, pose});
  return scene;
}

TEST(CompareMesh, MeasuresInTheFrameOfTheTruth) {
  const io::Scene truth = TrueScene();
  io::Sim3d scene_from_truth;
  scene_from_truth.scale = 3;
  scene_from_truth.rotation << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  scene_from_truth.translation = {4, 5, 6};
  io::Scene train = truth;
  for (io::Frame& frame : train.frames) {
    frame.image_path = frame.image_path.stem().string() + ".png";
    frame.world_from_cam = io::TransformPose(scene_from_truth, frame.world_from_cam);
  }
  const io::Aabb box = {Vec3::Constant(-100), Vec3::Constant(100)};
  const auto compare = [&](float offset, float right, double reach) {
    const io::Mesh mesh = io::TransformedMesh(scene_from_truth, RaisedTable(offset, right));
    return samples::CompareMesh(mesh, train, truth, {.box = box, .reach = reach, .threads = 2});
  };
  const auto fits = compare(0.01f, 1.5f, 0.015);
  ASSERT_EQ(fits.size(), 3u);
  const samples::MeshFit &things = fits[0], &still_life = fits[1], &all = fits[2];
  EXPECT_EQ(things.mesh_points, 0u);
  EXPECT_NEAR(still_life.median, 0.01, 2e-4);
  EXPECT_GT(still_life.mesh_points, 20000u);
  EXPECT_GT(still_life.share_within, 0.4);  // the table top, of all that stands on it
  EXPECT_LT(all.share_within, still_life.share_within - 0.1);
  EXPECT_GT(all.true_points, 1.2 * static_cast<double>(still_life.true_points));
  EXPECT_LT(things.share_within, 0.05);
  // Half of the table, and a mesh that is out of reach.
  EXPECT_NEAR(compare(0.01f, 0, 0.015)[1].share_within, 0.5 * still_life.share_within, 0.1);
  EXPECT_LT(compare(0.01f, 1.5f, 0.005)[1].share_within, 0.05);
}

TEST(CompareMesh, NeedsTheTruthOfTheSameCapture) {
  io::Scene truth = TrueScene(), train = truth;
  for (io::Frame& frame : train.frames) frame.image_path = "another_" + frame.image_path.stem().string();
  EXPECT_ERROR(
      samples::CompareMesh(RaisedTable(0, 1), train, truth, {}), io::ExitCode::kBadInput, "true pose");
}

}  // namespace
