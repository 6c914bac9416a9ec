#include "pipeline/stages/program_change.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <vector>

#include "io/base/error.h"

namespace pipeline {

void ContinueIn(const std::string& name, const std::string& stage, int argc, const char* const* argv) {
  const std::string program = std::filesystem::read_symlink("/proc/self/exe").parent_path() / name;
  std::vector<char*> arguments = {const_cast<char*>(program.c_str()), const_cast<char*>(stage.c_str())};
  for (int i = 1; i < argc; ++i) arguments.push_back(const_cast<char*>(argv[i]));
  arguments.push_back(nullptr);
  execv(program.c_str(), arguments.data());
  throw io::Error(io::ExitCode::kMissingTool,
                  program + ": " + std::strerror(errno),
                  "Build all targets; it stands beside `pipeline`");
}

}  // namespace pipeline
