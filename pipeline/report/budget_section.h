// The part of the report that says where the error of unseen views lies, and what would lower it.
#pragma once

#include <string>

#include "pipeline/evaluation/scores.h"

namespace pipeline {

// HTML; empty where no budget was measured.
std::string BudgetSection(const Scores& scores);

}  // namespace pipeline
