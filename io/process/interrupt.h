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

// Asks for the same clean stop, for a reason that is no signal; any thread may. The first reason counts.
void StopBecause(const Error& reason);
std::optional<Error> StopReason();

}  // namespace io
