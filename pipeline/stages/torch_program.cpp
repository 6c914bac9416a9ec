#include "pipeline/stages/torch_program.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <vector>

#include "io/base/error.h"
#include "nerf/fields/checkpoint.h"
#include "nerf/fields/mlp.h"

namespace pipeline {

bool NeedsTorch(const std::filesystem::path& checkpoint) {
  return std::filesystem::exists(checkpoint) && nerf::KindOfCheckpoint(checkpoint) == nerf::FieldKind::kMlp;
}

void ContinueWithTorch(const std::string& stage, int argc, const char* const* argv) {
  if (nerf::HasMlpFactory()) return;
  const std::string program =
      std::filesystem::read_symlink("/proc/self/exe").parent_path() / "pipeline-torch";
  std::vector<char*> arguments = {const_cast<char*>(program.c_str()), const_cast<char*>(stage.c_str())};
  for (int i = 1; i < argc; ++i) arguments.push_back(const_cast<char*>(argv[i]));
  arguments.push_back(nullptr);
  execv(program.c_str(), arguments.data());
  throw io::Error(io::ExitCode::kMissingTool,
                  program + ": " + std::strerror(errno),
                  "Build all targets; it stands beside `pipeline`");
}

}  // namespace pipeline
