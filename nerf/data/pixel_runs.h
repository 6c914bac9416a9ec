// Which pixels are used, without a list of them all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace nerf {

// Used pixels without a gap. Ranks count the used pixels of all views.
struct PixelRun {
  std::uint32_t first_rank, first_pixel;
};

// The used pixels of all views. 8 bytes per run: a few kilobytes per picture, and never more than 4 bytes per
// pixel.
class PixelRuns {
 public:
  PixelRuns() = default;
  // By rising rank, and one more entry that ends the last.
  explicit PixelRuns(std::vector<PixelRun> runs);

  bool empty() const { return runs_.empty(); }
  std::size_t size() const { return runs_.empty() ? 0 : runs_.back().first_rank; }
  // The used pixel of a rank in [0, size).
  std::size_t Pixel(std::size_t rank) const {
    std::size_t run = run_of_block_[rank / kBlock];
    while (runs_[run + 1].first_rank <= rank) ++run;
    return runs_[run].first_pixel + (rank - runs_[run].first_rank);
  }

 private:
  static constexpr std::size_t kBlock = 64;  // ranks; most runs are longer
  std::vector<PixelRun> runs_;
  std::vector<std::uint32_t> run_of_block_;  // the run of its first rank
};

}  // namespace nerf
