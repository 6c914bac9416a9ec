#include "io/process/shared_work.h"

#include <exception>
#include <new>

#include "io/base/check.h"
#include "io/base/error.h"
#include "io/base/packed.h"
#include "io/process/ranks.h"

namespace io {
namespace {

// On any rank; or it is not done yet. Then the others do not listen.
bool& WorkHasFailed() {
  static bool has_failed = false;
  return has_failed;
}

// What went wrong here, as the others get to know it: the exit code and a text; empty when nothing did.
std::string FailureOf(const std::exception_ptr& exception) {
  if (!exception) return "";
  const auto text = [](ExitCode code, const std::string& what) {
    return static_cast<char>(code) + std::string(what);
  };
  try {
    std::rethrow_exception(exception);
  } catch (const Error& error) {
    return text(error.code(), error.what());
  } catch (const std::bad_alloc&) {
    return text(ExitCode::kNoResources, "out of memory");
  } catch (const std::exception& error) {
    return text(ExitCode::kLostRank, error.what());
  }
}

// Computes the tasks of this rank, and gathers those of all when no rank failed.
TaskResults ComputeTogether(std::size_t n, const OwnWork& own) {
  TaskResults results(n);
  std::exception_ptr exception;
  WorkHasFailed() = true;
  try {
    const std::vector<std::size_t> tasks = OwnTasks(n);
    TaskResults computed = own(tasks);
    PIPELINE_CHECK(computed.size() == tasks.size());
    for (std::size_t i = 0; i < tasks.size(); ++i) results[tasks[i]] = std::move(computed[i]);
  } catch (const Interrupted&) {  // this rank's end tells the others
    throw;
  } catch (...) {
    exception = std::current_exception();
  }
  const std::vector<std::string> failures = AllRanks().AllGather(FailureOf(exception));
  if (exception) std::rethrow_exception(exception);
  for (std::size_t r = 0; r < failures.size(); ++r) {
    if (failures[r].empty()) continue;
    throw Error(static_cast<ExitCode>(failures[r].front()),
                "rank " + std::to_string(r) + ": " + failures[r].substr(1));
  }
  GatherTasks(&results);
  WorkHasFailed() = false;
  return results;
}

}  // namespace

TaskResults ShareOut(const std::string& name,
                     std::size_t n,
                     const std::function<std::string()>& tell,
                     const OwnWork& own) {
  PIPELINE_CHECK(AllRanks().IsFirst());
  if (AllRanks().AreSeveral()) {
    std::string message = Packer().Add(true).Add(name).Add(n).Add(tell()).Take();
    AllRanks().Broadcast(&message);
  }
  return ComputeTogether(n, own);
}

void Help(const ToldWorks& works) {
  for (;;) {
    std::string bytes;
    AllRanks().Broadcast(&bytes);
    Unpacker message(bytes);
    const bool is_work = message.Take<bool>();
    if (!is_work) return;
    const ToldWork& work = works.at(message.Take<std::string>());
    const auto n = message.Take<std::size_t>();
    const auto told = message.Take<std::string>();
    ComputeTogether(n, [&](const std::vector<std::size_t>& tasks) { return work(told, tasks); });
  }
}

HelpOfOthers::HelpOfOthers() { WorkHasFailed() = false; }

HelpOfOthers::~HelpOfOthers() {
  if (WorkHasFailed()) return;
  try {
    std::string message = Packer().Add(false).Take();
    AllRanks().Broadcast(&message);
  } catch (const std::exception&) {  // a rank is lost, or this one was interrupted: its end tells the others
  }
}

}  // namespace io
