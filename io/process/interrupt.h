// Ctrl-C and SIGTERM: the first one asks for a clean stop, the second one ends the process at once.
#pragma once

#include <optional>

#include "io/base/error.h"

namespace io {

// Installs the handlers; called once at the start of each `main`.
void InstallInterruptHandlers();

// The signal received, or 0. Long loops poll it, bring their state to disk and throw io::Interrupted.
int PendingInterrupt();

// Throws io::Interrupted when a signal is pending.
void ThrowIfInterrupted();

// For calls into libraries that nothing can interrupt. While one lives, a signal after which the process
// still runs two seconds later ends it as a kill would, with the exit code of a clean stop; so it may stand
// only where a kill loses nothing. It holds for the whole process, whichever thread made it.
class PromptStop {
 public:
  PromptStop();
  ~PromptStop();
  PromptStop(const PromptStop&) = delete;
  PromptStop& operator=(const PromptStop&) = delete;
};

// Asks for the same clean stop, for a reason that is no signal; any thread may. The first reason counts.
void StopBecause(const Error& reason);
std::optional<Error> StopReason();

}  // namespace io
