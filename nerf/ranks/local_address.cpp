#include "nerf/ranks/local_address.h"

#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <memory>

#include "io/base/error.h"

namespace nerf {
namespace {

// A UDP socket sends nothing when it connects: the kernel only looks up the way.
std::string SourceOfTrafficTo(const addrinfo& target) {
  const int fd = socket(target.ai_family, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return "";
  sockaddr_storage source{};
  socklen_t length = sizeof source;
  char text[NI_MAXHOST] = "";
  auto* address = reinterpret_cast<sockaddr*>(&source);
  if (connect(fd, target.ai_addr, target.ai_addrlen) == 0 && getsockname(fd, address, &length) == 0)
    getnameinfo(address, length, text, sizeof text, nullptr, 0, NI_NUMERICHOST);
  close(fd);
  return text;
}

}  // namespace

std::string LocalAddress(const std::string& host) {
  addrinfo hints{}, *found = nullptr;
  hints.ai_socktype = SOCK_DGRAM;
  const int fault = getaddrinfo(host.c_str(), "1", &hints, &found);
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> targets(found, freeaddrinfo);
  for (const addrinfo* target = found; target != nullptr && fault == 0; target = target->ai_next) {
    const std::string source = SourceOfTrafficTo(*target);
    if (!source.empty()) return source;
  }
  throw io::Error(io::ExitCode::kBadInput,
                  "MASTER_ADDR=" + host + ": " + (fault != 0 ? gai_strerror(fault) : "cannot be reached"),
                  "It is the name or address of the machine of rank 0");
}

std::string HostName() {
  char name[256] = "";
  gethostname(name, sizeof name - 1);
  return name;
}

}  // namespace nerf
