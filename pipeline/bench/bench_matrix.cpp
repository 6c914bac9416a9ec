// `pipeline bench sfm --matrix`: generated hard cases with truth.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>

#include "io/base/atomic_file.h"
#include "io/base/error.h"
#include "io/process/interrupt.h"
#include "pipeline/bench/bench.h"
#include "pipeline/bench/bench_table.h"
#include "sfm/synthetic/hard_cases.h"

namespace pipeline {
namespace {

// Noisy cases may fail in one seed of twenty.
constexpr double kPassingShare = 0.95;

struct Cell {
  const sfm::HardCase* hard_case;
  std::vector<sfm::HardCaseResult> results;  // of seeds 1, 2, ...
};

// "S05" selects S05.1, S05.2, ...; "S05.2" itself alone.
std::vector<Cell> SelectCells(const std::vector<std::string>& wanted) {
  std::vector<Cell> cells;
  std::set<std::string> unknown(wanted.begin(), wanted.end());
  for (const sfm::HardCase& c : sfm::HardCases()) {
    const std::string group = c.id.substr(0, c.id.find('.'));
    if (wanted.empty() || std::count(wanted.begin(), wanted.end(), c.id) > 0 ||
        std::count(wanted.begin(), wanted.end(), group) > 0)
      cells.push_back({&c, {}});
    unknown.erase(c.id);
    unknown.erase(group);
  }
  if (!unknown.empty()) {
    throw io::Error(io::ExitCode::kUsage,
                    "--cases: '" + *unknown.begin() + "' is unknown",
                    "Hard cases are named S01 to S45; see sfm/synthetic/hard_case_table.cpp");
  }
  return cells;
}

bool HasPassed(const Cell& cell) {
  const auto count = [&](auto of) {
    return static_cast<double>(std::count_if(cell.results.begin(), cell.results.end(), of));
  };
  const auto n = static_cast<double>(cell.results.size());
  const double needed = cell.hard_case->options.noise_px > 0 ? std::ceil(kPassingShare * n) : n;
  return count([&](const sfm::HardCaseResult& r) { return sfm::Passes(*cell.hard_case, r); }) >= needed &&
         count(sfm::IsFolded) == 0;
}

void PrintCell(const Cell& cell) {
  std::vector<double> rotations, centres;
  std::map<std::string, int> causes;
  int registered = 0, pictures = 0, folded = 0;
  double wall_s = 0, cpu_s = 0;
  for (const sfm::HardCaseResult& r : cell.results) {
    wall_s += r.wall_s;
    cpu_s += r.cpu_s;
    folded += sfm::IsFolded(r);
    if (!r.failure.empty()) {
      ++causes["FAILED: " + r.failure.substr(0, r.failure.find('\n'))];
    } else if (r.refusal) {
      ++causes[sfm::Name(r.refusal->cause)];
    } else {
      registered += r.registered;
      pictures += r.pictures;
      rotations.push_back(r.error.rotation_max_deg);
      if (!std::isnan(r.error.centre_rmse)) centres.push_back(r.error.centre_rmse);
    }
  }
  const auto quantiles = [](std::vector<double> values) {
    if (values.empty()) return std::string("-");
    std::sort(values.begin(), values.end());
    const auto at =
        static_cast<std::size_t>(std::ceil(kPassingShare * static_cast<double>(values.size()))) - 1;
    return fmt::format("{:.2g}/{:.2g}", values[at], values.back());
  };
  std::printf("%-4s %-6s %-46s %4d/%-4d rotation %-17s centre %-17s folded %d  %6.1f s %6.1f CPU s ",
              HasPassed(cell) ? "ok" : "FAIL",
              cell.hard_case->id.c_str(),
              cell.hard_case->title.c_str(),
              registered,
              pictures,
              quantiles(rotations).c_str(),
              quantiles(centres).c_str(),
              folded,
              wall_s,
              cpu_s);
  for (const auto& [cause, count] : causes) std::printf(" %d x %s", count, cause.c_str());
  std::printf("\n");
  std::fflush(stdout);
}

void WriteMatrix(const std::filesystem::path& path, const std::vector<Cell>& cells) {
  const std::string machine = BenchMachine(), commit = BenchCommit();
  std::string text =
      "machine,commit,case,title,seed,passed,folded,pictures,registered,rotation_median_deg,rotation_max_deg,"
      "centre_rmse,centre_max,auc_0.5,auc_1,auc_3,auc_5,focal_error,points_behind,doming,camera_model,wall_s,"
      "cpu_s,"
      "refusal,failure\n";
  for (const Cell& cell : cells) {
    for (std::size_t i = 0; i < cell.results.size(); ++i) {
      const sfm::HardCaseResult& r = cell.results[i];
      std::vector<std::string> fields = {machine,
                                         commit,
                                         cell.hard_case->id,
                                         cell.hard_case->title,
                                         std::to_string(i + 1),
                                         sfm::Passes(*cell.hard_case, r) ? "1" : "0",
                                         sfm::IsFolded(r) ? "1" : "0",
                                         std::to_string(r.pictures),
                                         std::to_string(r.registered),
                                         CsvNumber(r.error.rotation_median_deg),
                                         CsvNumber(r.error.rotation_max_deg),
                                         CsvNumber(r.error.centre_rmse),
                                         CsvNumber(r.error.centre_max)};
      for (const double auc : r.error.auc) fields.push_back(CsvNumber(auc));
      for (const std::string& field : {CsvNumber(r.focal_error),
                                       std::to_string(r.points_behind),
                                       CsvNumber(r.doming),
                                       r.camera_model,
                                       CsvNumber(r.wall_s),
                                       CsvNumber(r.cpu_s),
                                       r.refusal ? r.refusal->Message() : "",
                                       r.failure})
        fields.push_back(field);
      text += CsvLine(fields);
    }
  }
  io::WriteFileAtomically(path, text);
}

}  // namespace

void RunMatrix(const MatrixOptions& options) {
  std::vector<Cell> cells = SelectCells(options.cases);
  std::printf(
      "%zu hard cases, %d seeds each; rotation in degrees, centre over the extent, each as 95 %% / worst "
      "seed\n",
      cells.size(),
      options.seeds);
  int passed = 0, folded = 0;
  for (Cell& cell : cells) {
    for (int seed = 1; seed <= options.seeds; ++seed) {
      io::ThrowIfInterrupted();
      cell.results.push_back(sfm::RunHardCase(
          *cell.hard_case, static_cast<std::uint64_t>(seed), options.out / "work", options.threads));
      folded += sfm::IsFolded(cell.results.back());
    }
    PrintCell(cell);
    passed += HasPassed(cell);
    WriteMatrix(options.out / "matrix.csv", cells);
  }
  std::printf("%d of %zu hard cases passed, %d folded models\n", passed, cells.size(), folded);
}

}  // namespace pipeline
