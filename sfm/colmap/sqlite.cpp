#include "sfm/colmap/sqlite.h"

#include <memory>

#include "io/base/error.h"

namespace sfm {

using Statement = std::unique_ptr<sqlite3_stmt, decltype(&sqlite3_finalize)>;

SqliteConnection::SqliteConnection(const std::filesystem::path& path) : path_(path) {
  if (sqlite3_open_v2(path.c_str(), &handle_, SQLITE_OPEN_READWRITE, nullptr) == SQLITE_OK) return;
  const std::string message = sqlite3_errmsg(handle_);
  sqlite3_close(handle_);
  handle_ = nullptr;
  Fail(message);
}

SqliteConnection::~SqliteConnection() { sqlite3_close(handle_); }

void SqliteConnection::ForEachRow(const std::string& query,
                                  const std::function<void(sqlite3_stmt*)>& visit) const {
  sqlite3_stmt* raw = nullptr;
  if (sqlite3_prepare_v2(handle_, query.c_str(), -1, &raw, nullptr) != SQLITE_OK) Fail();
  const Statement statement(raw, sqlite3_finalize);
  int result = SQLITE_ROW;
  while ((result = sqlite3_step(raw)) == SQLITE_ROW) visit(raw);
  if (result != SQLITE_DONE) Fail();
}

void SqliteConnection::Execute(const std::string& command,
                               const std::function<void(sqlite3_stmt*)>& bind) const {
  sqlite3_stmt* raw = nullptr;
  if (sqlite3_prepare_v2(handle_, command.c_str(), -1, &raw, nullptr) != SQLITE_OK) Fail();
  const Statement statement(raw, sqlite3_finalize);
  if (bind) bind(raw);
  if (sqlite3_step(raw) != SQLITE_DONE) Fail();
}

bool SqliteConnection::HasTable(const std::string& name) const {
  bool found = false;
  ForEachRow("SELECT name FROM sqlite_master WHERE type = 'table' AND name = '" + name + "'",
             [&](sqlite3_stmt*) { found = true; });
  return found;
}

void SqliteConnection::Fail(const std::string& what) const {
  const int error = sqlite3_errcode(handle_);
  if (what.empty() && (error == SQLITE_FULL || error == SQLITE_IOERR || error == SQLITE_NOMEM)) {
    throw io::Error(io::ExitCode::kNoResources,
                    path_.string() + ": " + sqlite3_errmsg(handle_),
                    "Free some disk or memory, or raise the limits that ulimit -a shows");
  }
  throw io::Error(io::ExitCode::kBadState,
                  path_.string() + ": " + (what.empty() ? sqlite3_errmsg(handle_) : what),
                  "It is written anew by running the stage again with --force");
}

}  // namespace sfm
