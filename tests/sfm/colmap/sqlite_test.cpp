// What SQLite reports becomes the exit code that fits.
#include "sfm/colmap/sqlite.h"

#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "io/base/error.h"
#include "tests/support/files/temp_dir.h"

namespace {

TEST(Sqlite, NoRoomIsNoFaultOfTheDatabase) {
  const TempDir dir;
  WriteText(dir / "a.db", "");  // which SQLite takes for a database without tables
  const pid_t child = fork();
  if (child == 0) {
    signal(SIGXFSZ, SIG_IGN);
    const rlimit limit = {100'000, 100'000};
    setrlimit(RLIMIT_FSIZE, &limit);
    try {
      const sfm::SqliteConnection database(dir / "a.db");
      database.Execute("CREATE TABLE t (bytes BLOB)");
      database.Execute("INSERT INTO t VALUES (zeroblob(1000000))");
      _exit(0);
    } catch (const io::Error& error) {
      _exit(static_cast<int>(error.code()));
    }
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), static_cast<int>(io::ExitCode::kNoResources));
}

TEST(Sqlite, AFaultAmongTheRowsIsNotTheirEnd) {
  const TempDir dir;
  WriteText(dir / "a.db", "");
  const sfm::SqliteConnection database(dir / "a.db");
  database.Execute("CREATE TABLE t (n INTEGER)");
  database.Execute("INSERT INTO t VALUES (1), (-9223372036854775808)");
  int n_rows = 0;
  // The smallest integer has no absolute value.
  EXPECT_ERROR(database.ForEachRow("SELECT abs(n) FROM t", [&](sqlite3_stmt*) { ++n_rows; }),
               io::ExitCode::kBadState,
               "integer overflow");
  EXPECT_EQ(n_rows, 1);
}

}  // namespace
