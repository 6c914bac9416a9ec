// The secret by which the ranks of a run know one another.
#include "pipeline/stages/run_secret.h"

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "tests/support/files/temp_dir.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kNoPatience(0);

TEST(RunSecret, TheFirstRankWritesItOnceForItsUserAloneAndAllReadIt) {
  const TempDir dir;
  const fs::path out = dir / "run";
  const std::string secret = RunSecret(out, true, kNoPatience);
  EXPECT_EQ(secret.size(), 32u);
  EXPECT_EQ(RunSecret(out, false, kNoPatience), secret);
  EXPECT_EQ(RunSecret(out, true, kNoPatience), secret);
  EXPECT_EQ(fs::status(out / ".ranks.secret").permissions(), fs::perms::owner_read | fs::perms::owner_write);
}

TEST(RunSecret, WhoWaitsInVainSaysForWhat) {
  const TempDir dir;
  EXPECT_ERROR(RunSecret(dir / "run", false, kNoPatience),
               io::ExitCode::kLostRank,
               ".ranks.secret: rank 0 has not written it within 0 s");
}

TEST(RunSecret, OneThatCannotBeWrittenIsNamed) {
  const TempDir dir;
  fs::create_directories(dir / "run");
  RunSecret(dir / "run", true, kNoPatience);
  fs::remove(dir / "run/.ranks.secret");
  fs::create_directory(dir / "run/.ranks.secret");
  EXPECT_ERROR(RunSecret(dir / "run", true, kNoPatience),
               io::ExitCode::kNoResources,
               ".ranks.secret: cannot be written");
}

}  // namespace
}  // namespace pipeline
