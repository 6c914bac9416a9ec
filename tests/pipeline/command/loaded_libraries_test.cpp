// What the programs load when they start: libraries that a stage never calls cost it more time than small
// work.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <string>
#include <vector>

#include "io/base/atomic_file.h"
#include "io/process/process.h"
#include "tests/support/files/temp_dir.h"

namespace {

namespace fs = std::filesystem;

// As `ldd` lists them.
std::string LibrariesOf(const std::string& program) {
  const TempDir dir;
  setenv("LD_TRACE_LOADED_OBJECTS", "1", 1);
  const io::ProcessReport report =
      io::RunProcess({(fs::path(BINARY_DIR) / "bin" / program).string()}, {.log_path = dir / "log"});
  unsetenv("LD_TRACE_LOADED_OBJECTS");
  EXPECT_TRUE(report.Ok()) << program;
  return io::ReadFile(dir / "log");
}

TEST(LoadedLibraries, AreThoseThatAProgramCalls) {
#ifndef LINKED_BY_LLD
  GTEST_SKIP() << "only LLD leaves out what dropped functions call";
#endif
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "AddressSanitizer keeps functions that nothing calls, and so their libraries";
#endif
  struct Row {
    const char* program;
    std::vector<const char*> without;
  };
  const Row rows[] = {{"pipeline", {"libopencv", "libceres", "libtorch", "libopenblas"}},
                      {"pipeline-ingest", {"libceres", "libtorch"}},
                      {"pipeline-sfm", {"libopencv_videoio", "libtorch"}},
                      {"pipeline-normalize", {"libopencv_videoio", "libceres", "libtorch"}},
                      {"pipeline-train", {"libopencv_videoio", "libceres", "libtorch"}},
                      {"pipeline-evaluate", {"libopencv_videoio", "libceres", "libtorch"}},
                      {"pipeline-render", {"libceres", "libtorch"}},
                      {"pipeline-report", {"libopencv_videoio", "libceres", "libtorch"}}};
  for (const Row& row : rows) {
    const std::string libraries = LibrariesOf(row.program);
    EXPECT_NE(libraries.find("libc.so"), std::string::npos) << row.program << '\n' << libraries;
    for (const char* library : row.without)
      EXPECT_EQ(libraries.find(library), std::string::npos) << row.program << " loads " << library;
  }
}

}  // namespace
