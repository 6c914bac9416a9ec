// Which of this machine's addresses another one is reached from.
#pragma once

#include <string>

namespace nerf {

// The numeric address that traffic to `host` starts from. Throws kBadInput when there is no way to it.
std::string LocalAddress(const std::string& host);

std::string HostName();

}  // namespace nerf
