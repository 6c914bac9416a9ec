// Whether the held-out views were reconstructed, or the training pictures only memorised.
#pragma once

#include <string>
#include <vector>

#include "pipeline/evaluation/scores.h"

namespace pipeline {

enum class Outcome { kReconstructed, kDoubtful, kFailed };

struct Verdict {
  Outcome outcome = Outcome::kReconstructed;
  std::string text;                 // cause and figures; empty when reconstructed
  std::vector<std::string> strays;  // held-out views far below the others, worst first
};

// By medians over views, so that a single bad picture decides nothing:
//   failed    when held-out views lie less than 3 dB above a picture of one colour, or have 4 times the
//             squared error of training pictures (6 dB), lie less than 10 dB above one colour, which leaves
//             more than a tenth of what there is to see unexplained, and hide a fifth of the sparse points
//             behind what does not stand there (where points are known: few pictures leave gaps in a right
//             scene, too);
//   doubtful  else, from twice the squared error of training pictures on (3 dB); where views lie 10 dB above
//             one colour and hide less than a fifth of the points, from 4 times on.
// Strays lie 6 dB or more below the median. Scores without training figures are judged by the others.
Verdict Judge(const Scores& scores);

}  // namespace pipeline
