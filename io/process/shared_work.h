// Work that rank 0 shares out (ranks.h) when only it knows what is next: it calls ShareOut, and the others,
// which are in Help meanwhile, compute their tasks as well.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace io {

// The results of tasks, in their order.
using TaskResults = std::vector<std::string>;
using OwnWork = std::function<TaskResults(const std::vector<std::size_t>& tasks)>;
// The same on another rank, from what rank 0 tells about all tasks.
using ToldWork = std::function<TaskResults(const std::string& told, const std::vector<std::size_t>& tasks)>;
using ToldWorks = std::map<std::string, ToldWork>;

// On rank 0: the results of tasks [0, n), computed by `own` here and by the work of that name elsewhere.
// tell: only called when there are several ranks. An exception on any rank ends the work on all: that rank
// gets it as it is, the others an Error with the same code that names the rank.
TaskResults ShareOut(const std::string& name,
                     std::size_t n,
                     const std::function<std::string()>& tell,
                     const OwnWork& own);

// On the other ranks: computes until rank 0 needs no more help.
void Help(const ToldWorks& works);

// Rank 0 has one while it may share out work; at its end the others return from Help.
class HelpOfOthers {
 public:
  HelpOfOthers();
  ~HelpOfOthers();
  HelpOfOthers(const HelpOfOthers&) = delete;
  HelpOfOthers& operator=(const HelpOfOthers&) = delete;
};

}  // namespace io
