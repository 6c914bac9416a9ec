// The one error type of the project: every failure is one line saying what failed, on which file or value,
// and the remedy, and it carries the exit code of the process. Thrown anywhere, caught once in each `main`.
#pragma once

#include <stdexcept>
#include <string>

namespace io {

// Process exit codes, documented in README.md. A signal n ends the process with 128 + n.
enum class ExitCode {
  kOk = 0,
  kUsage = 2,               // unknown flag, key or value
  kBadInput = 3,            // a file or folder the user gave cannot be used
  kNotReconstructible = 4,  // the capture has no solution; the message names the cause
  kMissingTool = 5,         // a program, library or CPU feature is missing, or an external program failed
  kNoResources = 6,         // disk or memory
  kLocked = 7,              // another process works in the run folder
  kBadState = 8,            // a checkpoint or model of ours is damaged or does not belong here
  kNumeric = 9,             // non-finite loss that roll-back could not cure
  kNotReconstructed = 10,   // film and report are there, but held-out views do not show the scene
  kLostRank = 11,           // another process of a run on several ranks ended or was cut off
  kInternal = 70,           // a bug of ours
};

class Error : public std::runtime_error {
 public:
  Error(ExitCode code, const std::string& what_failed, const std::string& remedy = "")
      : std::runtime_error(remedy.empty() ? what_failed : what_failed + ". " + remedy), code_(code) {}
  ExitCode code() const { return code_; }

 private:
  ExitCode code_;
};

// Thrown when SIGINT or SIGTERM was received and work has been brought to a clean state.
class Interrupted : public std::runtime_error {
 public:
  explicit Interrupted(int signal) : std::runtime_error("interrupted"), signal_(signal) {}
  int signal() const { return signal_; }

 private:
  int signal_;
};

}  // namespace io
