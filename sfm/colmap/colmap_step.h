// One call of COLMAP, as the parts of the driver describe it.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "sfm/colmap/colmap.h"

namespace sfm {

constexpr const char* kDatabase = "database.db";

struct Colmap::Step {
  std::string command;
  std::vector<std::string> arguments;
  std::filesystem::path log;
  double limit_s = 0;
  // The mapper exits with 1 when it finds no initial pair, and can start models over and over without end.
  bool may_find_nothing = false;
  std::function<void()> on_tick;
};

}  // namespace sfm
