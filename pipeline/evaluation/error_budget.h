// Where the error of held-out views lies, and what would lower it.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "io/scene/scene.h"
#include "nerf/rendering/trained_field.h"
#include "pipeline/evaluation/scores.h"

namespace pipeline {

// Of more views than this, so many evenly spread ones are looked at.
inline constexpr std::size_t kBudgetViews = 24;

// Sets the error budgets of the views, which are the frames of `test`, and their mean. Takes about four
// renders of each, and small ones of the training views.
void MeasureErrors(const nerf::TrainedField& field,
                   const io::Scene& train,
                   const io::Scene& test,
                   int threads,
                   Scores* scores);

// What the budget advises, one sentence each, what gains most first; nothing where no cause stands out or
// none was measured.
std::vector<std::string> Advice(const Scores& scores);

}  // namespace pipeline
