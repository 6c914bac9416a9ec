// Writes the seeds of the fuzz targets, small files of each kind: write_seeds FOLDER makes FOLDER/<target>/.
#include <nlohmann/json.hpp>

#include "io/image/image.h"
#include "io/scene/ply.h"
#include "io/scene/transforms.h"
#include "io/video/video_writer.h"
#include "nerf/fields/checkpoint.h"
#include "pipeline/stage/frames.h"
#include "pipeline/stage/run_record.h"
#include "tests/fuzz/fuzz_input.h"
#include "tests/support/files/small_colmap_model.h"
#include "tests/support/scenes/small_field.h"
#include "tests/support/scenes/some_splats.h"

namespace {

namespace fs = std::filesystem;
using Files = std::vector<std::string>;

class Seeds {
 public:
  explicit Seeds(fs::path folder) : folder_(std::move(folder)) {}
  void Add(const std::string& target, const Files& files) {
    std::string input;
    for (const std::string& file : files) input += (input.empty() ? "" : std::string(fuzz::kNextFile)) + file;
    WriteText(folder_ / target / std::to_string(n_++), input);
  }

 private:
  fs::path folder_;
  int n_ = 0;
};

void AddScenes(Seeds* seeds) {
  const TempDir dir;
  io::Scene scene;
  scene.cameras = {{.width = 8, .height = 6, .fl_x = 10, .fl_y = 9, .cx = 4, .cy = 3}};
  fs::create_directories(dir / "images");
  for (const char* name : {"images/a.png", "images/b.png"}) {
    io::WriteImage(dir / name, io::MakeImage(8, 6, 3));
    scene.frames.push_back({.image_path = dir / name});
  }
  scene.frames[1].world_from_cam.translation = {1, 0, 0};
  scene.points = {{.xyz = {0, 0, -1}, .frame_indices = {0, 1}}, {.xyz = {1, 0, -2}}};
  io::WritePly(dir / "points.ply", scene.points);
  const std::string points = ReadText(dir / "points.ply");
  const std::string ascii =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nend_header\n1 2 3 4\n";
  seeds->Add("ply", {points});
  seeds->Add("ply", {ascii});
  io::WriteTransforms(dir / "transforms.json", scene, "points.ply");
  seeds->Add("transforms", {ReadText(dir / "transforms.json"), points});
  scene.near = 2, scene.far = 6, scene.unbounded = true;
  scene.aabb = {{-2, -2, -2}, {2, 2, 2}};
  io::WriteTransforms(dir / "transforms.json", scene, "points.ply");
  seeds->Add("transforms", {ReadText(dir / "transforms.json"), ascii});
  const std::string matrix = "[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]";
  seeds->Add("transforms",
             {R"({"camera_angle_x": 0.7, "frames": [{"file_path": "./images/a", "transform_matrix": )" +
              matrix + "}]}"});
  seeds->Add("transforms",
             {R"({"fl_x": 9, "k1": 0.1, "k2": 0, "p1": 0, "p2": 0, "cx": 4, "cy": 3, "w": 8, "h": 6, )"
              R"("aabb_scale": 4, "frames": [{"file_path": "images/b.png", "sharpness": 30, )"
              R"("transform_matrix": )" +
              matrix + "}]}"});
}

void AddModels(Seeds* seeds) {
  const TempDir dir;
  WriteBinary(SmallModel(), dir.path());
  WriteText(SmallModel(), dir.path());
  for (const char* form : {".bin", ".txt"}) {
    Files files;
    for (const char* name : {"cameras", "images", "points3D"})
      files.push_back(ReadText(dir / (std::string(name) + form)));
    seeds->Add("colmap_model", files);
  }
}

void AddCheckpoint(Seeds* seeds) {
  constexpr std::size_t kLengthAt = 8, kHeaderAt = 44;
  const TempDir dir;
  nerf::SceneField scene_field = tests::SmallField();
  scene_field.splats = tests::SomeSplats(2);
  nerf::TrainState state;
  state.splats.moments = nerf::FirstMoments(scene_field.splats);
  nerf::WriteCheckpoint(dir / "checkpoint.bin", &scene_field, state);
  const std::string file = ReadText(dir / "checkpoint.bin");
  std::uint32_t length;
  std::memcpy(&length, file.data() + kLengthAt, sizeof length);
  seeds->Add("checkpoint", {file.substr(kHeaderAt, length), file.substr(kHeaderAt + length)});
}

void AddRecords(Seeds* seeds) {
  const TempDir dir;
  pipeline::WriteFrames(
      dir / "frames.json",
      {.kept = {{.name = "a.png", .source = "a.png", .width = 8, .height = 6, .focal_px = 9, .notes = {"x"}}},
       .dropped = {{.source = "b.png", .reason = "blurred"}}});
  seeds->Add("record", {ReadText(dir / "frames.json")});
  pipeline::RecordRun(dir / "run", {{"input", "photos"}});
  pipeline::RecordStage(dir / "run", "train", {{"status", "done"}, {"wall_s", 1.5}});
  seeds->Add("record", {ReadText(dir / "run/run.json")});
}

void AddPictures(Seeds* seeds) {
  io::Image image = io::MakeImage(16, 12, 3);
  for (std::size_t i = 0; i < image.data.size(); ++i) image.data[i] = static_cast<std::uint8_t>(5 * i);
  for (const char* extension : {".png", ".jpg", ".tiff", ".webp"}) {
    const std::vector<std::uint8_t> bytes = io::EncodeImage(image, extension);
    seeds->Add("photo", {std::string(bytes.begin(), bytes.end())});
  }
  // APP1 with an EXIF block of one entry, the orientation, behind the start of a JPEG.
  const std::vector<std::uint8_t> bytes = io::EncodeImage(image, ".jpg");
  const std::string exif(
      "\xff\xe1\0\x22"
      "Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0",
      36);
  const std::string jpeg(bytes.begin(), bytes.end());
  seeds->Add("photo", {jpeg.substr(0, 2) + exif + jpeg.substr(2)});
}

void AddVideo(Seeds* seeds) {
  const auto box = [](const std::string& type, const std::string& payload) {
    const auto n = static_cast<char>(payload.size() + 8);
    return std::string(3, '\0') + n + type + payload;
  };
  const std::string handler = box("hdlr", std::string(8, '\0') + "vide" + std::string(12, '\0'));
  const std::string header = box("tkhd", std::string(84, '\0'));
  const std::string track = box("trak", header + box("mdia", handler));
  seeds->Add("mp4", {box("ftyp", "isom" + std::string(4, '\0')) + box("moov", track)});
}

void AddCommandLines(Seeds* seeds) {
  seeds->Add("options", {"--out\nrun\n--seed=7\n--rate 0.3\n--no-flag\n--kind\nnerf\ninput"});
  seeds->Add("options",
             {"--config\nconfig.json\n--time\n1.5m", R"({"seed": 3, "flag": true, "kind": "hash"})"});
  seeds->Add("options", {"--help"});
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  Seeds seeds(argv[1]);
  AddScenes(&seeds);
  AddModels(&seeds);
  AddCheckpoint(&seeds);
  AddRecords(&seeds);
  AddPictures(&seeds);
  AddVideo(&seeds);
  AddCommandLines(&seeds);
}
