// Ranks that exchange bytes over TCP: c10d of LibTorch, that is TCPStore, where they find one another, and
// Gloo between every two of them.
//
// Each rank tells every other one each second that it lives. One that is killed is missed at once, one that
// is stopped or cut off after kSilence; the work of the others then stops (io::StopBecause) with one line
// that names it.
#pragma once

#include <chrono>
#include <memory>

#include "io/process/meeting.h"

namespace nerf {

inline constexpr std::chrono::seconds kSilence(20);

// Returns when all ranks are there. Throws kLocked when the port or the rank is taken. Ends the process with
// kLostRank when a rank does not come, and at a signal: c10d waits without asking.
std::unique_ptr<io::Ranks> JoinByGloo(const io::Meeting& meeting);

}  // namespace nerf
