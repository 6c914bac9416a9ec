// Memory that a process may take. A budget decides how much is done at once and whether work begins at all,
// never what comes out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace io {

// Bytes that Linux can hand out without swapping, and that the limits of this process's control groups leave.
std::size_t FreeMemoryBytes();

// Resident memory of this process now.
std::size_t HeldMemoryBytes();

class MemoryBudget {
 public:
  // Of a whole process, what it holds already included. The default is without bounds.
  explicit MemoryBudget(std::size_t bytes = SIZE_MAX) : bytes_(bytes) {}

  std::size_t bytes() const { return bytes_; }

  // Throws kNoResources with both figures unless `more` bytes fit beside what the process holds. work:
  // "train: 100 pictures of 800 x 600".
  void Require(std::size_t more, const std::string& work) const;

  // How many of `most` equal pieces of work, each of `each` bytes, fit at once beside `more` bytes and what
  // the process holds; at least one.
  int Fits(int most, std::size_t each, std::size_t more = 0) const;
  // The same; as Require when not even one fits.
  int AtOnce(int most, std::size_t each, std::size_t more, const std::string& work) const;

 private:
  std::size_t bytes_;
};

// Makes Linux refuse memory beyond the budget (RLIMIT_DATA), so that what a plan has missed ends as
// std::bad_alloc. What libraries have mapped and not touched does not count, nor do the stacks of `threads`
// threads, of which little is used. Processes that are started get what is left.
void LimitMemory(const MemoryBudget& budget, int threads);

// What LimitMemory leaves to another process now; SIZE_MAX without a limit.
std::size_t MemoryLeftBytes();

// Throws std::bad_alloc where errno says that memory was refused. Libraries that fail for lack of it often
// say no more than that they failed: set errno to 0 before the call and ask afterwards.
void ThrowIfMemoryWasRefused();

// "1.5 GiB", "300 MiB".
std::string MemoryText(std::size_t bytes);

}  // namespace io
