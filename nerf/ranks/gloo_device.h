// The thread of Gloo that moves what ranks tell one another.
#pragma once

#include <memory>
#include <string>

namespace gloo::transport {
class Device;
}

namespace nerf {

// On the network interface of `address`; of low priority, since it spins.
std::shared_ptr<gloo::transport::Device> MakeGlooDevice(const std::string& address);

}  // namespace nerf
