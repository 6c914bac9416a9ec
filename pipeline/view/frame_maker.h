// Renders the pictures that pages ask for. A picture that is no longer wanted is given up between bands of
// rows, and while training goes on rendering keeps to its share of the machine.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/film/camera_path_file.h"
#include "pipeline/view/live_run.h"

namespace pipeline {

enum class ViewLayer { kColour, kDepth, kSupport };

// Fast: while a hand moves, one ray per pixel. Full: as the film. Finest: as pictures are scored.
enum class ViewQuality { kFast, kFull, kFinest };

struct FrameRequest {
  std::string viewer;          // pages are told apart by this
  std::uint64_t sequence = 0;  // a page's later requests replace its earlier ones
  io::Camera camera;
  io::Rigid3d world_from_cam;  // OpenGL axes
  ViewLayer layer = ViewLayer::kColour;
  ViewQuality quality = ViewQuality::kFast;
  std::optional<Crop> crop;
};

struct ViewFrame {
  std::vector<std::uint8_t> jpeg;
  double render_ms = 0;
};

class FrameMaker {
 public:
  // training_share: of a training's time, what it gives up for frames and the checkpoints that they show.
  FrameMaker(int threads, double training_share) : threads_(threads), training_share_(training_share) {}

  // Nothing when a later request of the same page has come, or there is nothing to show. Called from several
  // threads, whose pictures are rendered by turns. Throws io::Interrupted.
  std::optional<ViewFrame> Make(const FrameRequest& request, const LiveRun::Content& content);

  // The same as floats, without turns.
  static nerf::RenderedView Render(const FrameRequest& request, const LiveRun::Content& content, int threads);

 private:
  void NoteRequest(const FrameRequest& request);
  bool IsWanted(const FrameRequest& request) const;
  // Renders a part of a picture when it is its turn; false when the request was replaced meanwhile.
  bool InTurn(const FrameRequest& request,
              const LiveRun::Content& content,
              const std::function<void()>& part);
  std::optional<nerf::RenderedView> RenderInTurns(const FrameRequest& request,
                                                  const LiveRun::Content& content);

  const int threads_;
  const double training_share_;
  mutable std::mutex latest_mutex_;
  std::map<std::string, std::uint64_t> latest_;  // sequence by viewer
  std::mutex render_mutex_;
  double not_before_s_ = 0;  // of the next band, on the steady clock; guarded by render_mutex_
};

// The sparse points as a camera sees them, nearer ones before farther ones, on a dark ground.
nerf::RenderedView RenderPoints(const std::vector<io::Point3D>& points,
                                const io::Camera& camera,
                                const io::Rigid3d& world_from_cam);

}  // namespace pipeline
