// A few lines around SQLite's C interface: errors become io::Error, statements are closed.
#pragma once

#include <sqlite3.h>

#include <filesystem>
#include <functional>
#include <string>

namespace sfm {

class SqliteConnection {
 public:
  // Opens an existing file for reading and writing: read-only, SQLite could not fold a write-ahead log in.
  // Throws io::Error kBadState, or kNoResources where disk or memory lack, as all members do.
  explicit SqliteConnection(const std::filesystem::path& path);
  ~SqliteConnection();
  SqliteConnection(const SqliteConnection&) = delete;
  SqliteConnection& operator=(const SqliteConnection&) = delete;

  // visit(row): read with sqlite3_column_*.
  void ForEachRow(const std::string& query, const std::function<void(sqlite3_stmt*)>& visit) const;

  // bind(statement): sets the parameters with sqlite3_bind_*.
  void Execute(const std::string& command, const std::function<void(sqlite3_stmt*)>& bind = {}) const;

  bool HasTable(const std::string& name) const;

  // what: SQLite's message when empty.
  [[noreturn]] void Fail(const std::string& what = "") const;

 private:
  std::filesystem::path path_;
  sqlite3* handle_ = nullptr;
};

}  // namespace sfm
