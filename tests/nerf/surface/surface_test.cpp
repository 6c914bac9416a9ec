// The whole way from a field to a mesh: a sphere, whose surface, colours and seen part are known.
#include "nerf/surface/surface.h"

#include <gtest/gtest.h>

#include <numbers>

#include "io/base/error.h"
#include "io/image/mask.h"
#include "nerf/surface/mesh_repair.h"
#include "tests/support/files/temp_dir.h"
#include "tests/support/scenes/look_at.h"
#include "tests/support/scenes/sphere_field.h"

namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kPi = std::numbers::pi;

// Views of 160 x 120 pixels from a ring above the unit sphere and one below.
io::Scene TwoRings(int per_ring = 10) {
  io::Scene scene = tests::RingScene(per_ring, 160, 120, [](int) { return ""; });
  for (int i = 0; i < per_ring; ++i) {
    const Vector3d above = scene.frames[static_cast<std::size_t>(i)].world_from_cam.translation;
    const Vector3d below(above.x(), above.y(), -above.z());
    scene.frames.push_back({"", 0, LookAt(below, Vector3d::Zero(), Vector3d::UnitZ()), {}});
  }
  return scene;
}

// Number of views whose camera is on the outer side of the tangent plane.
int Facing(const io::Scene& scene, const Vector3f& p) {
  int n = 0;
  for (const io::Frame& frame : scene.frames)
    n += p.cast<double>().dot(frame.world_from_cam.translation) > p.cast<double>().squaredNorm();
  return n;
}

TEST(ExtractSurface, FindsTheSphereWithItsNormalsAndColours) {
  const io::Scene scene = TwoRings();
  const nerf::Surface surface = nerf::ExtractSurface(tests::SphereField(), scene, {.threads = 2});
  const io::Mesh& mesh = surface.mesh;
  io::CheckMesh(mesh);
  ASSERT_GT(mesh.triangles.size(), 5000u);
  EXPECT_NEAR(surface.area, 4 * kPi, 0.02 * 4 * kPi);
  EXPECT_EQ(surface.pieces, 0);
  int n_right = 0, n_certain = 0;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vector3f& p = mesh.positions[i];
    // The poles are seen at a slant of 78 degrees, by views of which a pixel covers a cell there.
    EXPECT_NEAR(p.norm(), 1, (std::abs(p.z()) < 0.7f ? 0.15 : 1) * surface.voxel);
    EXPECT_GT(mesh.normals[i].dot(p.normalized()), 0.97f);
    // Away from the edges of the chequers, which pixels and vertices cut differently.
    const double u = 5 * std::atan2(p.y(), p.x()), v = 4 * static_cast<double>(p.z());
    if (std::abs(u - std::round(u)) > 0.3 || std::abs(v - std::round(v)) > 0.3) continue;
    const bool dark = (std::lround(u) + std::lround(v)) % 2 != 0;
    ++n_certain;
    n_right += std::abs(mesh.colours[i][0] - (dark ? 51 : 204)) < 20 &&
               std::abs(mesh.colours[i][2] - 0.6 * (dark ? 51 : 204)) < 15;
  }
  EXPECT_GT(n_certain, 1000);
  EXPECT_GT(n_right, 0.95 * n_certain);
}

TEST(ExtractSurface, GoesToTheSparsePointsNearIt) {
  io::Scene scene = TwoRings();
  const double radius = 1 + nerf::ExtractSurface(tests::SphereField(), scene, {.threads = 2}).voxel;
  for (int i = 0; i < 2000; ++i) {  // evenly over the sphere
    const double z = (2 * i + 1) / 2000.0 - 1, angle = kPi * (3 - std::sqrt(5)) * i, r = std::sqrt(1 - z * z);
    scene.points.push_back({.xyz = radius * Vector3d(r * std::cos(angle), r * std::sin(angle), z)});
  }
  const nerf::Surface surface = nerf::ExtractSurface(tests::SphereField(), scene, {.threads = 2});
  EXPECT_GT(surface.fitted_points, 1500u);
  EXPECT_GT(surface.point_offset_px, 0.5);
  EXPECT_EQ(surface.Decisions().size(), 5u);
  EXPECT_NEAR(surface.area, 4 * kPi * radius * radius, 0.01 * 4 * kPi);
}

TEST(ExtractSurface, EndsWhereFewerViewsSawTheSphereThanAskedFor) {
  io::Scene scene = TwoRings();
  std::erase_if(scene.frames,
                [](const io::Frame& frame) { return frame.world_from_cam.translation.x() < 0; });
  for (const int least : {1, 2, 4}) {
    const nerf::Surface surface =
        nerf::ExtractSurface(tests::SphereField(), scene, {.threads = 2, .least_views = least});
    std::size_t n_fewer = 0;
    for (const Vector3f& p : surface.mesh.positions) n_fewer += Facing(scene, 0.98f * p) < least;
    EXPECT_EQ(n_fewer, 0u) << least;
    EXPECT_GT(surface.unseen_triangles, least > 1 ? 1000u : 0u);
    EXPECT_LT(surface.area, (least > 1 ? 0.9 : 1.02) * 4 * kPi);
  }
}

TEST(ExtractSurface, LeavesOutWhatMasksDo) {
  const TempDir dir;
  io::Scene scene = TwoRings();
  io::Mask mask{.width = 160, .height = 120, .used = std::vector<std::uint8_t>(160 * 120, 255)};
  for (int y = 60; y < 120; ++y) std::fill_n(mask.used.begin() + 160 * y, 160, 0);  // the lower half is not
  io::WriteMask(dir / "mask.png", mask);
  scene.frames.resize(10);  // from above
  const nerf::Surface whole = nerf::ExtractSurface(tests::SphereField(), scene, {.threads = 2});
  for (io::Frame& frame : scene.frames) frame.mask_path = dir / "mask.png";
  const nerf::Surface upper = nerf::ExtractSurface(tests::SphereField(), scene, {.threads = 2});
  const auto lowest = [](const io::Mesh& mesh) {
    float z = 1;
    for (const Vector3f& p : mesh.positions) z = std::min(z, p.z());
    return z;
  };
  EXPECT_LT(lowest(whole.mesh), -0.6f);
  EXPECT_GT(lowest(upper.mesh), 0.2f);  // where the axis through the middle of the pictures meets the sphere
}

TEST(ExtractSurface, KeepsToBoxAndBudget) {
  const io::Aabb box = {Vector3d(-1.2, -1.2, 0.1), Vector3d(1.2, 1.2, 1.2)};
  nerf::SurfaceOptions options{.threads = 2, .box = box, .triangles = 1000};
  double last = -1;
  std::vector<std::string> steps;
  options.progress = [&](const char* what, double share) {
    if (steps.empty() || steps.back() != what) steps.push_back(what), last = -1;
    EXPECT_GT(share, last);
    last = share;
  };
  const nerf::Surface surface = nerf::ExtractSurface(tests::SphereField(), TwoRings(), options);
  EXPECT_LE(surface.mesh.triangles.size(), 1000u);
  EXPECT_GT(surface.mesh.triangles.size(), 900u);
  EXPECT_GT(surface.decimated_triangles, 1000u);
  EXPECT_NEAR(surface.area, 2 * kPi * 0.9, 0.3);  // of the cap above the box's floor
  for (const Vector3f& p : surface.mesh.positions) EXPECT_NEAR(p.norm(), 1, surface.voxel);
  EXPECT_EQ(steps, (std::vector<std::string>{"depth", "fusion", "mesh"}));
  EXPECT_EQ(last, 1);
  EXPECT_EQ(surface.Decisions().size(), 4u);
}

TEST(ExtractSurface, SaysWhatIsImpossible) {
  const tests::SphereField field;
  const io::Scene scene = TwoRings(3);
  const io::Aabb elsewhere = {Vector3d(2, 2, 2), Vector3d(3, 3, 3)}, flat = {{0, 0, 0}, {1, 1, 0}};
  EXPECT_ERROR(nerf::ExtractSurface(field, scene, {.box = elsewhere}), io::ExitCode::kBadInput, "no surface");
  EXPECT_ERROR(nerf::ExtractSurface(field, scene, {.box = flat}), io::ExitCode::kBadInput, "box of the mesh");
  EXPECT_ERROR(nerf::ExtractSurface(field, scene, {.voxel = 1e-5}), io::ExitCode::kBadInput, "too fine");
  EXPECT_ERROR(nerf::ExtractSurface(field, scene, {.voxel = -1}), io::ExitCode::kBadInput, "too fine");
}

TEST(CaptureBox, IsThatOfThePointsWhereCamerasDoNotLookAtOnePlace) {
  io::Scene scene = TwoRings();
  scene.unbounded = true;
  for (int i = 0; i < 100; ++i)
    scene.points.push_back({.xyz = Vector3d(0.1 * i, -0.2 * i, i == 99 ? 1000 : 5 + 0.01 * i)});
  EXPECT_EQ(nerf::CaptureBox(scene).max, scene.aabb.max);
  for (io::Frame& frame : scene.frames)  // turned around: all look away from the middle
    frame.world_from_cam.rotation =
        frame.world_from_cam.rotation * Vector3d(-1, 1, -1).asDiagonal().toDenseMatrix();
  const io::Aabb box = nerf::CaptureBox(scene);
  EXPECT_NEAR(box.min.x(), 0.1, 0.101);
  EXPECT_NEAR(box.max.x(), 9.7, 0.101);
  EXPECT_NEAR(box.min.y(), -19.5, 0.21);
  EXPECT_LT(box.max.z(), 6);  // the stray point is left out
  scene.unbounded = false;
  EXPECT_EQ(nerf::CaptureBox(scene).max, scene.aabb.max);
}

}  // namespace
