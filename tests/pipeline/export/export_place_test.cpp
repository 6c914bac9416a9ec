// What exports may replace, and that a folder appears whole or not at all.
#include "pipeline/export/export_place.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include "io/base/error.h"
#include "io/base/owned_folder.h"
#include "pipeline/export/ply_table.h"
#include "tests/support/files/temp_dir.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;
using io::ExitCode;

class ExportPlace : public testing::Test {
 protected:
  ExportPlace() { io::ClaimFolder(run_); }
  const TempDir dir_;
  const fs::path run_ = dir_ / "run";
};

TEST_F(ExportPlace, FilesOfOthersAreKept) {
  const fs::path file = dir_ / "a.ply";
  EXPECT_NO_THROW(RequireExportFile(file, {".ply"}, run_, false));
  WriteText(file, "ply\ncomment by somebody\n");
  EXPECT_ERROR(RequireExportFile(file, {".ply"}, run_, false),
               ExitCode::kBadInput,
               file.string(),
               "not written",
               "--force");
  EXPECT_NO_THROW(RequireExportFile(file, {".ply"}, run_, true));
  WritePlyTable(file, {}, 0, {});
  EXPECT_NO_THROW(RequireExportFile(file, {".ply"}, run_, false));
  WriteText(file, "");
  EXPECT_ERROR(RequireExportFile(file, {".ply"}, run_, false), ExitCode::kBadInput, "not written");
  fs::create_directory(dir_ / "b.ply");
  EXPECT_ERROR(RequireExportFile(dir_ / "b.ply", {".ply"}, run_, true), ExitCode::kBadInput, "no file");
  EXPECT_ERROR(RequireExportFile(dir_ / "a.obj", {".ply"}, run_, true), ExitCode::kUsage, "a.obj", ".ply");
}

TEST_F(ExportPlace, FoldersOfOthersAndOtherFoldersOfOursAreKept) {
  const fs::path folder = dir_ / "f";
  EXPECT_NO_THROW(RequireExportFolder(folder, run_));
  fs::create_directory(folder);
  EXPECT_NO_THROW(RequireExportFolder(folder, run_));
  fs::create_directory_symlink(folder, dir_ / "link");
  for (const char* name : {"link", "link/"})
    EXPECT_ERROR(RequireExportFolder(dir_ / name, run_), ExitCode::kBadInput, "not written");
  WriteText(folder / "export.json", "{}");
  EXPECT_ERROR(RequireExportFolder(folder, run_), ExitCode::kBadInput, folder.string(), "not written");
  // Run folders bear the marker too.
  io::ClaimFolder(dir_ / "other run");
  WriteText(dir_ / "other run/run.json", "{}");
  EXPECT_ERROR(RequireExportFolder(dir_ / "other run", run_), ExitCode::kBadInput, "not written");
  WriteText(dir_ / "file", "x");
  EXPECT_ERROR(RequireExportFolder(dir_ / "file", run_), ExitCode::kBadInput, "not written");
}

TEST_F(ExportPlace, TheRunFolderAndWhatHoldsItAreNoPlace) {
  fs::create_directory_symlink(run_, dir_ / "link");
  for (const fs::path& folder :
       {run_, run_ / "", run_ / "scene", dir_.path(), dir_ / "link", dir_ / "x/../run/a"})
    EXPECT_ERROR(RequireExportFolder(folder, run_), ExitCode::kUsage, "run folder");
  EXPECT_ERROR(RequireExportFile(run_ / "a.ply", {".ply"}, run_, true), ExitCode::kUsage, "run folder");
  EXPECT_NO_THROW(RequireExportFolder(dir_ / "run2", run_));
}

TEST_F(ExportPlace, WhereNothingCanBeMadeIsSaidBeforeTheWork) {
  WriteText(dir_ / "file", "x");
  EXPECT_ERROR(RequireExportFile(dir_ / "file/deep/a.ply", {".ply"}, run_, true),
               ExitCode::kBadInput,
               "a.ply",
               "cannot be made");
  EXPECT_ERROR(RequireExportFolder(dir_ / "file/deep/a", run_), ExitCode::kBadInput, "cannot be made");
  EXPECT_NO_THROW(RequireExportFolder(dir_ / "new/deep/a", run_));
  EXPECT_NO_THROW(RequireExportFile("a name without a folder.ply", {".ply"}, run_, true));
}

TEST_F(ExportPlace, AFolderAppearsWhenItIsComplete) {
  const fs::path target = dir_ / "new/deep";
  {
    ExportFolder folder(target);
    WriteText(folder.path() / "a", "1");
    EXPECT_FALSE(fs::exists(target));
  }
  EXPECT_EQ(CountEntries(dir_ / "new"), 0);  // given up
  for (const char* text : {"1", "2"}) {
    ExportFolder folder(target / "");
    WriteText(folder.path() / "a", text);
    folder.Commit("cameras", {});
    EXPECT_EQ(ReadText(target / "a"), text);
  }
  EXPECT_NO_THROW(RequireExportFolder(target, run_));
  EXPECT_EQ(CountEntries(dir_ / "new"), 4);  // the folder, its marker, export.json, a
}

TEST_F(ExportPlace, WhatAKilledExportLeftIsSweptAndALivingOneIsNot) {
  // No process has the largest number; the parent of this one lives.
  const fs::path dead = dir_ / ".t.2147483647.partial",
                 alive = dir_ / (".t." + std::to_string(getppid()) + ".partial");
  const fs::path foreign = dir_ / ".t.x.partial";
  for (const fs::path& folder : {dead, alive, foreign}) io::ClaimFolder(folder);
  ExportFolder folder(dir_ / "t");
  EXPECT_FALSE(fs::exists(dead));
  EXPECT_TRUE(fs::exists(alive));
  EXPECT_TRUE(fs::exists(foreign));
}

}  // namespace
}  // namespace pipeline
