// Ctrl-C and SIGTERM: the first one asks for a clean stop, the second one ends the process at once.
#pragma once

namespace io {

// Installs the handlers; called once at the start of each `main`.
void InstallInterruptHandlers();

// The signal received, or 0. Long loops poll it, bring their state to disk and throw io::Interrupted.
int PendingInterrupt();

// Throws io::Interrupted when a signal is pending.
void ThrowIfInterrupted();

}  // namespace io
