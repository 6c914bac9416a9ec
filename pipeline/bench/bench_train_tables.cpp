#include "pipeline/bench/bench_train_tables.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <functional>

#include "io/base/atomic_file.h"
#include "pipeline/bench/bench_table.h"
#include "pipeline/report/plot_svg.h"

namespace pipeline {
namespace {

// Qualities to reach [dB]; 25.65 is what the report on the original NeRF has on Lego.
constexpr double kTargets[] = {25.65, 28, 30, 32, 33, 34, 35};

using Figure = std::function<double(const TrainingResult&)>;

Spread Over(const BudgetResults& runs, const Figure& figure) {
  std::vector<double> values;
  for (const TrainingResult& run : runs) values.push_back(figure(run));
  return SpreadOf(values);
}

Figure WallTo(double psnr_db) {
  return
      [=](const TrainingResult& run) { return SecondsTo(psnr_db, run.curve.wall_s, run.curve.heldout_psnr); };
}
Figure CpuTo(double psnr_db) {
  return
      [=](const TrainingResult& run) { return SecondsTo(psnr_db, run.curve.cpu_s, run.curve.heldout_psnr); };
}

// Budget and split of runs that differ in the seed alone.
std::string Label(const BudgetResults& runs) {
  return runs[0].holdout == "sector" ? runs[0].time + " sector" : runs[0].time;
}

struct NamedFigure {
  std::string name, unit;
  Figure figure;
};

std::vector<NamedFigure> Figures() {
  std::vector<NamedFigure> figures = {
      {"psnr", "dB", [](const TrainingResult& run) { return run.psnr_db; }},
      {"ssim", "1", [](const TrainingResult& run) { return run.ssim; }},
      {"steps", "step", [](const TrainingResult& run) { return run.steps; }},
      {"train", "s", [](const TrainingResult& run) { return run.train_s; }},
      {"samples", "1/s", [](const TrainingResult& run) { return run.samples_per_s; }},
      {"peak_rss", "byte", [](const TrainingResult& run) { return run.peak_rss_bytes; }},
  };
  for (const double target : kTargets) {
    figures.push_back({"wall_to_" + CsvNumber(target) + "dB", "s", WallTo(target)});
    figures.push_back({"cpu_to_" + CsvNumber(target) + "dB", "s", CpuTo(target)});
  }
  return figures;
}

std::string Seconds(double seconds) { return std::isfinite(seconds) ? fmt::format("{:.2f}", seconds) : "-"; }

void PrintTimes(const char* title, Figure (*to)(double), const std::vector<BudgetResults>& budgets) {
  std::printf("\n%s seconds to a held-out PSNR, median and range over the seeds; -: not reached\n%-12s",
              title,
              "budget");
  for (const double target : kTargets) std::printf(" %24s", (CsvNumber(target) + " dB").c_str());
  std::printf("\n");
  for (const BudgetResults& runs : budgets) {
    std::printf("%-12s", Label(runs).c_str());
    for (const double target : kTargets) {
      const Spread s = Over(runs, to(target));
      const bool has_range = std::isfinite(s.low) && runs.size() > 1;
      const std::string range = has_range ? " (" + Seconds(s.low) + " to " + Seconds(s.high) + ")" : "";
      std::printf(" %24s", (Seconds(s.median) + range).c_str());
    }
    std::printf("\n");
  }
}

}  // namespace

void PrintTraining(const std::vector<BudgetResults>& budgets) {
  std::printf("%-12s %5s %-26s %-26s %12s %9s %7s\n",
              "budget",
              "seeds",
              "PSNR dB (range)",
              "SSIM (range)",
              "M samples/s",
              "steps",
              "MiB");
  for (const BudgetResults& runs : budgets) {
    const Spread psnr = Over(runs, [](const TrainingResult& run) { return run.psnr_db; });
    const Spread ssim = Over(runs, [](const TrainingResult& run) { return run.ssim; });
    const Spread rate = Over(runs, [](const TrainingResult& run) { return run.samples_per_s * 1e-6; });
    const Spread steps = Over(runs, [](const TrainingResult& run) { return run.steps; });
    const Spread rss = Over(runs, [](const TrainingResult& run) { return run.peak_rss_bytes / (1 << 20); });
    std::printf("%-12s %5zu %-26s %-26s %12.3f %9.0f %7.0f\n",
                Label(runs).c_str(),
                runs.size(),
                fmt::format("{:.2f} ({:.2f} to {:.2f})", psnr.median, psnr.low, psnr.high).c_str(),
                fmt::format("{:.4f} ({:.4f} to {:.4f})", ssim.median, ssim.low, ssim.high).c_str(),
                rate.median,
                steps.median,
                rss.high);
  }
  PrintTimes("wall", WallTo, budgets);
  PrintTimes("CPU", CpuTo, budgets);
}

void WriteTrainingTable(const std::filesystem::path& path,
                        const std::vector<BudgetResults>& budgets,
                        const std::string& scene,
                        const std::string& settings) {
  std::vector<BenchValue> values;
  for (const BudgetResults& runs : budgets) {
    const std::string budget = fmt::format("time={} holdout={}", runs[0].time, runs[0].holdout);
    for (const NamedFigure& f : Figures()) {
      for (const TrainingResult& run : runs) {
        values.push_back({scene,
                          fmt::format("{} seed={}{} trained_by={}", budget, run.seed, settings, run.commit),
                          f.name,
                          f.unit,
                          f.figure(run)});
      }
      const Spread s = Over(runs, f.figure);
      const std::string parameters = fmt::format("{} seeds={}{}", budget, runs.size(), settings);
      values.push_back({scene, parameters, f.name + "_median", f.unit, s.median});
      values.push_back({scene, parameters, f.name + "_min", f.unit, s.low});
      values.push_back({scene, parameters, f.name + "_max", f.unit, s.high});
    }
  }
  WriteBenchTable(path, values);
}

void WriteTrainingPlot(const std::filesystem::path& path, const std::vector<BudgetResults>& budgets) {
  std::vector<PlotSeries> lines;
  for (const BudgetResults& runs : budgets) {
    PlotSeries line{.label = Label(runs)};
    // Seeds are monitored at slightly different moments: those of the first one stand for all.
    for (const double wall_s : runs[0].curve.wall_s) {
      const Spread psnr = Over(runs, [=](const TrainingResult& run) { return PsnrAt(wall_s, run.curve); });
      if (!std::isfinite(psnr.low + psnr.high)) continue;
      line.x.push_back(wall_s);
      line.y.push_back(psnr.median);
    }
    lines.push_back(std::move(line));
  }
  io::WriteFileAtomically(
      path,
      StandaloneSvg({PlotSvg(lines,
                             {.x_label = "wall seconds of training",
                              .y_label = "held-out PSNR [dB] by budget, median over seeds",
                              .log_x = true})}));
}

}  // namespace pipeline
