// What `pipeline bench train` prints and writes.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/bench/training_result.h"

namespace pipeline {

// The runs of one budget and one split, a seed each; never empty.
using BudgetResults = std::vector<TrainingResult>;

// Final quality, and the time to several qualities, medians and ranges over the seeds.
void PrintTraining(const std::vector<BudgetResults>& budgets);

// One line per run and figure, and per budget the median, least and greatest of each figure. scene and
// settings: what all runs share.
void WriteTrainingTable(const std::filesystem::path& path,
                        const std::vector<BudgetResults>& budgets,
                        const std::string& scene,
                        const std::string& settings);

// Held-out PSNR against wall seconds, a line per budget and split, the median over its seeds.
void WriteTrainingPlot(const std::filesystem::path& path, const std::vector<BudgetResults>& budgets);

}  // namespace pipeline
